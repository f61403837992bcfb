"""Repetitions of a value in efforts: at their bound, elsewhere, and while a joint goes there and back."""

import numpy as np
import pytest

from armload_identification.recording.reduction.repeated_values import RepeatCounter, repeated_values

pytestmark = pytest.mark.pure


def counted(values, position=None, blocks=1):
    values = np.asarray(values, dtype=float)[:, None]
    position = np.zeros_like(values) if position is None else np.asarray(position, dtype=float)[:, None]
    counter = RepeatCounter(1)
    for part in zip(np.array_split(values, blocks), np.array_split(position, blocks), strict=True):
        counter.add(*part)
    found = counter.found
    return {name: float(getattr(found, name)[0]) for name in found.__dataclass_fields__}


@pytest.mark.parametrize("blocks", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("values", "bound", "at_bound", "elsewhere"),
    [
        ([1, 2, 3, 2, 1], 3, 0, 0),
        ([1, 5, 5, 5, 2, 2, 1], 5, 2, 1),
        ([1, -5, -5, 5, 5, 5, 0], 5, 2, 0),
        ([2, 2, 2, 2, 1, 4, 4, 1], 4, 1, 3),
        ([4, 4, 4, 1, 7, 1, 1, 1], 7, 0, 2),
        ([0, 0, 0, 0], 0, 3, 0),
    ],
)
def test_sequences_at_the_greatest_magnitude_are_apart_whatever_the_blocks(values, bound, at_bound, elsewhere, blocks):
    found = counted(values, blocks=blocks)
    assert (found["bound"], found["at_bound"], found["elsewhere"]) == (bound, at_bound, elsewhere)


def there_and_back(position):
    """How far a joint had been beyond both its first and a later position, by trying all moments."""
    first, way = position[0], 0.0
    for now in range(len(position)):
        before = position[: now + 1]
        way = max(way, before.max() - max(position[now], first), min(position[now], first) - before.min())
    return way


@pytest.mark.parametrize("blocks", [1, 2, 5])
@pytest.mark.parametrize("offset", [-3.0, 0.0, 3.0])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_value_that_stays_while_the_joint_goes_there_and_back_is_found_with_the_way(blocks, offset, direction):
    angle = np.linspace(0.0, 2.3 * np.pi, 120)
    position = offset + direction * (np.sin(angle) + 0.1 * angle)
    values = np.concatenate([np.arange(30.0), np.full(120, 0.5), np.arange(30.0)])
    whole = np.concatenate([np.full(30, position[0]), position, np.full(30, position[-1])])
    found = counted(values, whole, blocks)
    assert found["turned_rad"] == pytest.approx(there_and_back(position))
    assert (found["turned_for"], found["turned_at"]) == (120.0, 0.5)


def test_a_joint_that_only_goes_on_and_a_short_sequence_turn_nothing():
    values = np.concatenate([np.arange(5.0), np.full(80, 0.5), np.arange(5.0)])
    assert counted(values, np.linspace(0.0, 4.0, 90))["turned_rad"] == 0.0
    short = np.concatenate([np.arange(5.0), np.full(49, 0.5), np.arange(36.0)])
    turning = np.sin(np.linspace(0.0, 6.0, 90))
    assert counted(short, turning)["turned_rad"] == 0.0
    long = np.concatenate([np.arange(5.0), np.full(50, 0.5), np.arange(35.0)])
    assert counted(long, turning)["turned_rad"] == pytest.approx(there_and_back(turning[5:55]))


def test_joints_are_counted_by_themselves_and_taken_in_any_order():
    values = np.array([[1.0, 5.0], [1.0, 6.0], [2.0, 6.0], [3.0, 6.0]])
    found = repeated_values(values, np.zeros_like(values))
    assert found.bound.tolist() == [3.0, 6.0]
    assert found.at_bound.tolist() == [0.0, 2.0]
    assert found.elsewhere.tolist() == [1.0, 0.0]
    assert found.joints(np.array([1, 0])).bound.tolist() == [6.0, 3.0]
