"""Impossible magnitudes are rejected, with the unit that they suggest; possible ones pass."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.recording.recording import Recording
from armload_identification.verdict.recording_checks.impossible_magnitudes import (
    ArmMagnitudes,
    require_possible,
    require_possible_mass,
    scale_notes,
)

pytestmark = pytest.mark.pure

NAMES = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")


@pytest.fixture(scope="module")
def chain_and_links(any_arm):
    return any_arm(np.random.default_rng(5), 6)


@pytest.fixture(scope="module")
def moved(chain_and_links):
    """Times, positions, and the links' torque with some friction."""
    time_s = np.arange(0.0, 10.0, 0.02)
    position = 1.2 * np.sin(np.outer(time_s, np.linspace(0.6, 1.6, 6)))
    still = np.zeros_like(position)
    torque = ArmDynamics(chain_and_links[0], body_of(chain_and_links[1])).torque(position, still, still)
    friction = 0.1 * torque.std(axis=0)
    return time_s, position, torque + friction * np.sign(np.gradient(position, axis=0))


def body_of(links):
    none = np.zeros(len(links))
    return ArmBody(np.array([link.theta for link in links]), none, none, none, np.eye(len(links)))


@pytest.fixture(scope="module")
def arm(chain_and_links, moved):
    """Ranges, speeds, strength and links."""
    strength = 2.0 * np.abs(moved[2]).max(axis=0) + 1.0
    least, greatest, fastest = np.full(6, -2.0), np.full(6, 2.0), np.full(6, 2.0)
    return ArmMagnitudes(NAMES, least, greatest, fastest, strength, body_of(chain_and_links[1]))


@pytest.fixture
def judged(chain_and_links, arm, moved):
    def judged(turn=1.0, strength=1.0, shift=0.0, **changes):
        time_s, position, torque = moved
        run = Recording.from_arrays(time_s, turn * position + shift, torque_nm=strength * torque, name="run")
        require_possible(run, chain_and_links[0], run.torque_nm, replace(arm, **changes))

    return judged


def test_what_the_arm_can_have_passes(judged):
    judged()
    judged(strength=0.4)
    judged(shift=0.9)
    unknown = np.full(6, np.nan)
    judged(position_min_rad=unknown, position_max_rad=unknown, torque_max_nm=unknown, body=None)
    judged(position_min_rad=np.full(6, -np.inf), position_max_rad=np.full(6, np.inf))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"turn": 15.0}, "base goes from -18 to 18, its range is -2 to 2 rad. The positions look like degrees"),
        ({"shift": 1.5}, "base goes from 0.3 to 2.7, its range is -2 to 2 rad. Is this a recording of another arm"),
        ({"strength": 1000.0}, "times its greatest torque.*Currents look like milliampere, or torques like N mm"),
        ({"strength": 0.01}, "look like those of the motors, on the input side of the gears.* if their file has g"),
        ({"strength": 1000.0, "torque_max_nm": np.full(6, np.nan)}, "Torques look like N mm, or currents like"),
        ({"strength": 40.0, "torque_max_nm": np.full(6, np.nan)}, "Is this a recording of this arm, in N m or A"),
    ],
)
def test_what_it_cannot_have_is_refused_with_what_it_looks_like(judged, changes, text):
    with pytest.raises(RecordingError, match=f"^run: .*{text}"):
        judged(**changes)


def test_a_torque_that_does_not_follow_the_links_is_not_judged_by_them(chain_and_links, arm, moved):
    time_s, position, torque = moved
    noise = 0.01 * np.random.default_rng(0).normal(size=torque.shape)
    run = Recording.from_arrays(time_s, position, torque_nm=noise)
    require_possible(run, chain_and_links[0], run.torque_nm, arm)
    require_possible(run, chain_and_links[0], None, arm)


def test_degrees_of_a_small_motion_show_in_its_speed(judged):
    """A wrist that turns by less than 0.1 rad, so that its degrees are possible radians."""
    degrees = np.append(np.ones(5), 0.08 * 180.0 / np.pi)
    wide = {"position_min_rad": np.full(6, -6.3), "position_max_rad": np.full(6, 6.3)}
    with pytest.raises(RecordingError, match=r"^run: wrist_3 reaches 8.\d+ rad/s, 4.\d times its .*degrees: .*q6_deg"):
        judged(turn=degrees, **wide)


@pytest.mark.parametrize("limit_rad_s", [0.2, 0.5, np.nan])
def test_limits_that_all_joints_exceed_are_those_of_a_slow_test(judged, limit_rad_s):
    judged(velocity_max_rad_s=np.full(6, limit_rad_s))


@pytest.mark.parametrize("strength", [1000.0, 0.001])
def test_a_single_joint_in_another_unit_is_named(judged, moved, strength):
    by_load = np.argsort(-moved[2].std(axis=0))
    for joint in (by_load[0], by_load[2]):
        with pytest.raises(RecordingError, match=rf"torque of {NAMES[joint]} is \S+ times .* links' weight"):
            judged(strength=np.where(np.arange(6) == joint, strength, 1.0), torque_max_nm=np.full(6, np.nan))


@pytest.mark.parametrize(
    ("mass_kg", "half_width_kg", "text"),
    [
        (57.4, 6.7, "57.4 kg, 4.6 times the rated payload of ur10e, 12.5 kg. Check units .N mm or milliampere"),
        (0.00095, 0.00005, "0.00095 kg, 0.008 % of the rated payload of ur10e, 12.5 kg. Check units .torques of the"),
    ],
)
def test_a_mass_that_the_arm_cannot_carry_or_feel_is_refused(mass_kg, half_width_kg, text):
    with pytest.raises(EstimationError, match=text):
        require_possible_mass(mass_kg, mass_kg + half_width_kg * np.array([-1.0, 1.0]), 12.5, "ur10e")


@pytest.mark.parametrize("interval_kg", [(0.011, 0.013), (20.0, 60.0), (np.nan, np.nan)])
def test_a_mass_that_may_be_within_the_arms_range_passes(interval_kg):
    require_possible_mass(57.4, np.array(interval_kg), 12.5, "ur10e")


@pytest.mark.parametrize(("strength", "said"), [(0.9, ""), (1.2, ""), (0.74, "0.7"), (0.102, "0.1"), (1.8, "1.8")])
def test_torque_of_another_unit_on_all_joints_is_noted_from_the_links_weight(
    chain_and_links, arm, moved, strength, said
):
    _, position, torque = moved
    run = SimpleNamespace(states=SimpleNamespace(position_rad=position), torque_nm=strength * torque)
    notes = list(scale_notes(run, chain_and_links[0], arm))
    assert bool(notes) is bool(said)
    assert not said or f"is {said}" in notes[0]
    assert not list(scale_notes(run, chain_and_links[0], replace(arm, body=None)))
