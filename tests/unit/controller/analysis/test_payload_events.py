"""From estimates to events: grasping, dropping, exchange of a payload, and a calibration that no longer holds."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.payload_events import PayloadEvents, kind_of_change
from armload_drivers.listening.overheard_arm import ToldPayload
from armload_identification.contact.force_watch import ForceEvent, ForceEventKind
from tests.live_estimates import live_estimate

HELD_S, MOVED_S = 10.0, 5.0

N = 3
NAMES = ("shoulder", "elbow", "wrist")
CALIBRATION = SimpleNamespace(drift=np.full((3, N), 0.5))


def found(time_s, mass_kg=0.0, width_kg=0.05, center_m=(0.0, 0.0, 0.05), **changes):
    return live_estimate(N, mass_kg, width_kg, center_m, time_s, **changes)


def events(*estimates):
    of = PayloadEvents(CALIBRATION, NAMES)
    return [str(event) for estimate in estimates for event in of.of(estimate)]


def test_a_payload_is_weighed_once_both_are_known():
    after = {"changes": 1, "changed_s": 5.4}
    assert events(
        found(5.0), found(6.0, 0.9, 0.4, **after), found(7.0, 0.7, 0.1, **after), found(8.0, 0.7, 0.05, **after)
    ) == ["changed", "grasped (+0.70 +- 0.11 kg)"]
    assert events(found(5.0, 0.7), found(6.0, **after)) == ["changed", "dropped (-0.70 +- 0.07 kg)"]


def test_another_tool_of_the_same_mass_is_known_by_its_centre():
    after = {"changes": 1, "changed_s": 5.4}
    tool, other = found(5.0, 2.0), found(6.0, 2.02, center_m=(0.0, 0.03, 0.05), **after)
    assert events(tool, other) == ["changed", "changed tool"]
    assert events(tool, replace(other, values=tool.values)) == ["changed"], "the same body again"
    unsure = replace(other, determined=np.array([True, False, False, False]))
    assert events(tool, unsure) == ["changed"]
    assert events(tool, replace(other, half_width_95=np.array([0.3, 0.003, 0.003, 0.003]))) == ["changed"]


def test_contact_begins_and_ends():
    assert events(found(1.0), found(2.0, contact=True), found(3.0, contact=True), found(4.0)) == [
        "contact",
        "contact over",
    ]


def test_forces_in_motion_are_told_with_joints_and_a_size_that_is_determined():
    shows = np.array([False, True, True])
    measured = SimpleNamespace(force_n=np.array([30.0, -40.0, 0.0]), force_deviation_n=np.array([3.0, 4.0, 0.0]))
    unsure = SimpleNamespace(force_n=np.array([30.0, -40.0, 0.0]), force_deviation_n=np.array([30.0, 40.0, 0.0]))
    happened = [
        ForceEvent(ForceEventKind.ACTING, 5.1, 5.1, shows),
        ForceEvent(ForceEventKind.PUSH, 5.6, 5.0, shows, measured),
        ForceEvent(ForceEventKind.OVER, 7.0, 6.5, shows),
        ForceEvent(ForceEventKind.PUSH, 9.6, 9.0, shows, unsure),
        ForceEvent(ForceEventKind.PAYLOAD, 12.0, 11.0, shows, measured),
        ForceEvent(ForceEventKind.NOTHING, 16.0, 13.0, np.zeros(N, dtype=bool)),
    ]
    told = PayloadEvents(CALIBRATION, NAMES).of_forces(happened)
    assert [(event.time_s, str(event)) for event in told] == [
        (5.1, "something acts: elbow, wrist"),
        (5.0, "contact (50 N: 30, -40, 0): elbow, wrist"),
        (6.5, "contact over"),
        (9.0, "contact: elbow, wrist"),
        (16.0, "nothing evident"),
    ]


@pytest.mark.parametrize(
    ("far", "expected"),
    [
        (1.0, []),
        (1.6, ["friction drifting: elbow"]),
        (2.6, ["calibration out of date: elbow", "friction drifting: elbow"]),
    ],
)
def test_friction_far_from_the_calibrations_is_said_once(far, expected):
    friction = np.zeros((3, N))
    friction[0, 1] = far
    assert events(*(found(time_s, friction=friction) for time_s in np.arange(0.0, 4.0 * HELD_S))) == expected


def test_friction_that_is_far_for_a_moment_is_nothing():
    far = np.full((3, N), 10.0)
    times = np.arange(0.0, 4.0 * HELD_S)
    assert not events(*(found(t, friction=far if t % HELD_S else np.zeros((3, N))) for t in times))
    still = np.full(N, 0.9 * MOVED_S)
    assert not events(*(found(t, friction=far, moving_s=still) for t in times)), "too little motion to know"


def test_less_than_nothing_is_a_calibration_that_does_not_hold():
    times = np.arange(0.0, 2.0 * HELD_S)
    assert events(*(found(t, -0.2) for t in times)) == ["calibration out of date"]
    assert not events(*(found(t, -0.04) for t in times))


@pytest.mark.parametrize(
    ("told_kg", "width_kg", "expected"),
    [
        (1.0, 0.1, ["controller told wrong (+1.50 kg)"]),
        (2.45, 0.1, []),
        (1.0, 2.0, []),
    ],
)
def test_what_the_controller_was_told_is_compared_with_what_was_found(told_kg, width_kg, expected):
    of = PayloadEvents(CALIBRATION, NAMES)
    told = ToldPayload(told_kg, (0.0, 0.0, 0.05))
    times = np.arange(0.0, 3.0 * HELD_S)
    assert [str(event) for time_s in times for event in of.of(found(time_s, 2.5, width_kg), told)] == expected
    corrected = [
        event for time_s in times for event in of.of(found(100.0 + time_s, 2.5, 0.1), ToldPayload(2.5, (0, 0, 0)))
    ]
    assert not corrected


def test_a_controller_that_states_no_payload_was_told_nothing_wrong():
    of = PayloadEvents(CALIBRATION, NAMES)
    assert not [event for time_s in np.arange(0.0, 3.0 * HELD_S) for event in of.of(found(time_s, 2.5))]


def estimate(mass_kg, width_kg, center_m=(0.0, 0.0, 0.05), center_width_m=0.002, known=(True, True, True, True)):
    given = found(0.0, mass_kg, width_kg, center_m)
    return replace(
        given, half_width_95=np.array([width_kg, *[center_width_m] * 3]), determined=np.array(known, dtype=bool)
    )


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (estimate(1.0, 0.1), estimate(2.0, 0.249), "grasped"),
        (estimate(1.0, 0.1), estimate(2.0, 0.251), None),
        (estimate(2.0, 0.249), estimate(1.0, 0.1), "dropped"),
        (estimate(2.0, 0.251), estimate(1.0, 0.1), None),
        (estimate(2.0, 0.1), estimate(2.05, 0.149, (0.0, 0.0, 0.08)), "changed tool"),
        (estimate(2.0, 0.1), estimate(2.05, 0.151, (0.0, 0.0, 0.08)), None),
        (estimate(2.0, 0.1), estimate(1.95, 0.149, (0.08, 0.0, 0.05)), "changed tool"),
        (estimate(2.0, 0.1), estimate(2.0, 0.1, (0.0, 0.0141, 0.05)), "changed tool"),
        (estimate(2.0, 0.1), estimate(2.0, 0.1, (0.0, 0.0139, 0.05)), None),
        (estimate(2.0, 0.1), estimate(2.0, 0.1, (0.0, 0.02, 0.05), known=(True, True, False, True)), None),
        (estimate(2.0, 0.1, known=(True, True, False, True)), estimate(2.0, 0.1, (0.0, 0.02, 0.05)), None),
    ],
)
def test_a_change_has_its_kind_from_a_quarter_a_tenth_and_a_centimetre_on(before, after, kind):
    """A quarter of the change of mass; a tenth of the mass; 10 mm beyond both half widths of 2 mm."""
    assert kind_of_change(before, after) == kind


@pytest.mark.parametrize(("deviation_n", "known"), [(16.6, True), (16.7, False)])
def test_a_force_of_three_deviations_has_a_direction(deviation_n, known):
    measured = SimpleNamespace(
        force_n=np.array([30.0, -40.0, 0.0]), force_deviation_n=np.array([deviation_n, 0.0, 0.0])
    )
    pushed = ForceEvent(ForceEventKind.PUSH, 5.6, 5.0, np.array([False, True, False]), measured)
    (event,) = PayloadEvents(CALIBRATION, NAMES).of_forces([pushed])
    assert (event.force_n is not None) is known


@pytest.mark.parametrize(
    ("moving_s", "times_s", "said"),
    [(5.0, (0.0, 10.0), True), (5.0, (0.0, 9.9), False), (4.9, (0.0, 10.0, 20.0), False)],
)
def test_a_sign_counts_after_five_seconds_of_motion_if_it_lasts_for_ten(moving_s, times_s, said):
    moving = np.array([0.0, moving_s, 1.0])
    assert bool(events(*(found(time_s, -0.2, moving_s=moving) for time_s in times_s))) is said
