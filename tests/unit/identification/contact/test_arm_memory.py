"""What the last minute says of payload and friction, against weighted least squares written out."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.contact.arm_memory import ArmMemory
from armload_identification.contact.contact_levels import CHECKPOINT_S, MEMORY_S, OLD_S, PART_ROWS
from armload_identification.contact.force_rows import PAYLOAD

pytestmark = pytest.mark.pure

STATES, JOINTS, STEP_S = PAYLOAD + 4, 2, 0.01
DENSITY = np.array([0.5, 2.0])


def rows(count, begin_s=0.0, seed=1):
    rng = np.random.default_rng(seed)
    return SimpleNamespace(
        size=count,
        time_s=begin_s + STEP_S * np.arange(count),
        columns=rng.normal(size=(count, JOINTS, STATES)),
        weight=rng.uniform(0.5, 1.0, size=(count, JOINTS)),
        residual_nm=rng.normal(size=(count, JOINTS)),
        doubt_nm=rng.uniform(0.0, 20.0, size=(count, JOINTS)),
    )


def root_of(given, steps_s):
    """Square roots of the weights."""
    return given.weight * np.sqrt(steps_s[:, None] / (DENSITY + given.doubt_nm**2 * steps_s[:, None]))


def fitted(given, steps_s):
    """Value and covariance of least squares with a prior of one for each unknown."""
    root = root_of(given, steps_s)
    matrix = (given.columns * root[:, :, None]).reshape(-1, STATES)
    target = (given.residual_nm * root).ravel()
    covariance = np.linalg.inv(np.eye(STATES) + matrix.T @ matrix)
    return covariance @ matrix.T @ target, covariance


def latest(memory):
    return memory.before(1e9)


def test_a_part_of_rows_counts_by_its_steps_weight_and_density():
    count = min(PART_ROWS, 50)
    given = rows(count)
    memory = ArmMemory(STATES)
    assert latest(memory) is None
    memory.add(given, DENSITY)
    steps = np.full(count, STEP_S)
    steps[0] = 0.0
    value, covariance = fitted(given, steps)
    found = latest(memory)
    assert found.time_s == given.time_s[-1]
    np.testing.assert_allclose(found.value, value)
    np.testing.assert_allclose(found.covariance, covariance)


def test_a_hole_counts_as_a_tenth_of_a_second_at_most_and_time_does_not_run_back():
    count = min(PART_ROWS, 20)
    given = rows(count)
    given.time_s[count // 2 :] += 5.0
    memory = ArmMemory(STATES)
    memory.add(given, DENSITY)
    steps = np.full(count, STEP_S)
    steps[0], steps[count // 2] = 0.0, 0.1
    np.testing.assert_allclose(latest(memory).value, fitted(given, steps)[0])


def test_what_was_learnt_fades_and_the_prior_does_not():
    """A second part long after the first: the first counts less by exp(-dt / memory)."""
    count = min(PART_ROWS, 30)
    first, second = rows(count), rows(count, begin_s=2.0 * MEMORY_S, seed=2)
    memory = ArmMemory(STATES)
    memory.add(first, DENSITY)
    memory.add(second, DENSITY)
    steps = np.full(count, STEP_S)
    alone = [fitted(first, np.append(0.0, steps[1:])), fitted(second, np.append(0.1, steps[1:]))]
    fade = np.exp(-(second.time_s[-1] - first.time_s[-1]) / MEMORY_S)
    information = [np.linalg.inv(covariance) - np.eye(STATES) for _, covariance in alone]
    right = [np.linalg.solve(covariance, value) for value, covariance in alone]
    covariance = np.linalg.inv(np.eye(STATES) + fade * information[0] + information[1])
    found = latest(memory)
    np.testing.assert_allclose(found.covariance, covariance)
    np.testing.assert_allclose(found.value, covariance @ (fade * right[0] + right[1]))


def remembered(memory):
    return [each.time_s for each in memory._known]


def test_states_are_kept_at_intervals_and_the_latest_before_a_time_is_found():
    memory = ArmMemory(STATES)
    for begin_s in np.arange(0.0, 40.0 * CHECKPOINT_S, 0.3 * CHECKPOINT_S):
        memory.add(rows(2, begin_s), DENSITY)
    times = remembered(memory)
    assert len(times) == 16
    assert (np.diff(times) >= CHECKPOINT_S - 1e-9).all()
    assert memory.before(times[5] + OLD_S).time_s == times[5]
    assert memory.before(times[5] + OLD_S - 1e-6).time_s == times[4]
    assert memory.before(times[0] + OLD_S - 1e-6) is None


@pytest.mark.parametrize("payload", [True, False])
def test_beginning_anew_keeps_friction_and_forgets_another_payload(payload):
    memory = ArmMemory(STATES)
    memory.add(rows(min(PART_ROWS, 30)), DENSITY)
    known = latest(memory)
    memory.begin_anew(known, payload=payload)
    (kept,) = memory._known
    np.testing.assert_array_equal(kept.value[PAYLOAD:], known.value[PAYLOAD:])
    np.testing.assert_array_equal(kept.covariance[PAYLOAD:, PAYLOAD:], known.covariance[PAYLOAD:, PAYLOAD:])
    if payload:
        assert kept is known
    else:
        np.testing.assert_array_equal(kept.value[:PAYLOAD], 0.0)
        np.testing.assert_array_equal(kept.covariance[:PAYLOAD, :PAYLOAD], np.eye(PAYLOAD))
        assert not kept.covariance[:PAYLOAD, PAYLOAD:].any()
    later = rows(2, begin_s=100.0, seed=3)
    memory.add(later, DENSITY)
    root = root_of(later, np.array([0.0, STEP_S]))
    matrix, target = (later.columns * root[:, :, None]).reshape(-1, STATES), (later.residual_nm * root).ravel()
    fade = np.exp(-STEP_S / MEMORY_S)
    before = np.linalg.inv(kept.covariance)
    information = np.eye(STATES) + fade * (before - np.eye(STATES)) + matrix.T @ matrix
    expected = np.linalg.solve(information, fade * before @ kept.value + matrix.T @ target)
    np.testing.assert_allclose(memory._known[-1].value, expected)
