"""Zeros of joints, a base, hoses and forces: on simulated runs in which one of them is wrong, and by its numbers."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.estimation.base_tilt import tilt_axes
from armload_identification.estimation.disturbances import Disturbances, Disturbed
from armload_identification.estimation.payload_problem import single_problem
from armload_identification.estimation.solve import solve
from armload_identification.pipeline.operator_notes import disturbance_notes
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.signals.recorded_run import Run
from tests.unit.conftest import GRAVITY_M_S2

JOINTS = 6
COUNT = 2 * JOINTS + 5
ZERO, TILT, HOSE, FORCE = 0, JOINTS, JOINTS + 2, 2 * JOINTS + 2


def turned(run, joint, angle_deg):
    """The run whose recorded position is higher than the joint's."""
    return replace(run, position_rad=run.position_rad + np.radians(angle_deg) * np.eye(JOINTS)[joint])


def with_torque(arm, run, torque_nm):
    current = torque_nm @ arm.transmission.coupling / arm.transmission.gain_nm_a
    return replace(run, current_a=run.current_a + current)


def states(run):
    found = run.excitation.trajectory.evaluate(run.phase_s)
    return found.position_rad, np.zeros_like(found.position_rad), np.zeros_like(found.position_rad)


def held_nm(arm, run, gravity_m_s2, payload):
    """(N, n) torque by gravity alone."""
    model = arm._model(payload)
    model.gravity.linear = np.asarray(gravity_m_s2)
    data = model.createData()
    return np.array([pin.rnea(model, data, *state) for state in zip(*states(run), strict=True)])


def tilted(arm, run, angle_deg):
    """The run on a base that tilts about x."""
    turn = pin.exp3(np.radians([angle_deg, 0.0, 0.0]))
    of = [held_nm(arm, run, gravity, arm.payload) for gravity in (turn @ GRAVITY_M_S2, GRAVITY_M_S2)]
    return with_torque(arm, run, of[0] - of[1])


def pulled(arm, run, force_n):
    """The run with a force on the flange in the base frame: the weight of 1 kg there, without inertia."""
    body = type(arm.payload).from_center_of_mass(1.0, [0.0, 0.0, 0.0], np.diag([1e-9] * 3))
    return with_torque(arm, run, held_nm(arm, run, force_n, body) - held_nm(arm, run, force_n, None))


def hung(arm, run, joint, torque_nm):
    """The run with a hose that holds a joint back."""
    position = states(run)[0][:, joint]
    away = (position - position.mean()) / position.std()
    return with_torque(arm, run, torque_nm * away[:, None] * np.eye(JOINTS)[joint])


CASES = {
    "nothing": (lambda _arm, pair: pair, "", 0.0),
    "zero": (lambda _arm, pair: [turned(run, 3, 1.0) for run in pair], "joint 4 stood", 1.0),
    "tilt": (lambda arm, pair: [tilted(arm, pair[0], 0.8), pair[1]], "the base had tilted by", 0.8),
    "hose": (
        lambda arm, pair: [hung(arm, pair[0], 4, 1.0), pair[1]],
        "a hose or cable held joint 5 back to the middle of its travel, with",
        1.0,
    ),
    "hose that pushes": (
        lambda arm, pair: [hung(arm, pair[0], 4, -1.0), pair[1]],
        "a hose or cable pushed joint 5 away from the middle of its travel, with",
        1.0,
    ),
    "force": (lambda arm, pair: [pulled(arm, pair[0], [0.0, 12.0, 0.0]), pair[1]], "a force of", 12.0),
    "pull": (lambda arm, pair: [pulled(arm, pair[0], [0.0, 0.0, -15.0]), pair[1]], "a force of", 15.0),
}


@pytest.mark.parametrize("calibrated", [False, True], ids=["nominal", "calibrated"])
@pytest.mark.parametrize("case", CASES)
def test_what_disturbs_a_pair_is_named_and_allowed_for(case, calibrated, pinocchio_arm, pair, calibration):
    disturb, words, expected = CASES[case]
    arm, chain, known = pinocchio_arm.transmission, pinocchio_arm.chain, None
    if calibrated:
        arm, chain, known = calibration.transmission(arm), calibration.level(chain), calibration.known_arm
    found = identify_runs(*disturb(pinocchio_arm, pair), chain, arm, arm=known)
    notes = [note for note in found.notes if note.startswith("The loaded run is as if ")]
    assert [words in note for note in notes] == ([True] if words else [])
    for note in notes:
        assert ("pulled the flange down" in note) == (case == "pull")
        assert ("base frame: " in note) == (case == "force")
        size, half_width = re.search(re.escape(words) + r" ([\d.]+) \+- ([\d.]+)", note).groups()
        assert abs(float(size) - expected) < float(half_width) + 0.03 * expected
        assert float(half_width) < 0.4 * expected
    if case == "pull":
        return
    truth = np.array([pinocchio_arm.payload.mass_kg, *pinocchio_arm.payload.center_of_mass_m])
    off = (found.uncertainty.values[:4] - truth) / found.uncertainty.half_width_95[:4]
    assert np.abs(off).max() < 1.1


def test_a_single_run_is_disturbed_since_the_calibration(pinocchio_arm, pair, calibration):
    arm = pinocchio_arm
    found = identify_runs(
        tilted(arm, pair[0], 0.8),
        None,
        calibration.level(arm.chain),
        calibration.transmission(arm.transmission),
        arm=calibration.known_arm,
    )
    (note,) = (note for note in found.notes if note.startswith("The loaded run is as if "))
    assert "the base had tilted by 0." in note
    assert "deg since the calibration" in note


def errors(values, deviation, across=()):
    """Errors with values and standard deviations at their places; of others the rows say nothing."""
    information = np.zeros((COUNT, COUNT))
    for place, size in deviation.items():
        information[place, place] = size**-2.0
    for (one, other), correlation in across:
        information[one, other] = information[other, one] = correlation / deviation[one] / deviation[other]
    x = np.zeros(COUNT)
    x[list(values)] = list(values.values())
    torque = np.random.default_rng(1).normal(size=(COUNT, 4, JOINTS))
    down = np.array([0.0, 0.0, -1.0])
    axes = np.stack([*tilt_axes(down), down])
    return Disturbances([torque], information @ x, information, np.full(JOINTS, 50.0), axes)


@pytest.mark.parametrize(
    ("place", "deviation", "named_from", "of"),
    [
        (ZERO + 2, 0.005, 3.4 * np.sqrt(0.005**2 + 0.0005**2 + 0.002**2), Disturbed.ZERO),
        (TILT, 0.0005, 0.005, Disturbed.TILT),
        (TILT + 1, 0.005, 3.9 * np.hypot(0.005, 0.0005), Disturbed.TILT),
        (HOSE + 5, 0.3, 3.4 * 0.3, Disturbed.HOSE),
        (HOSE + 5, 0.01, 0.5, Disturbed.HOSE),
        (FORCE + 1, 1.0, 4.2 * np.hypot(1.0, 0.5), Disturbed.FORCE),
        (FORCE + 2, 1.0, 3.4 * np.hypot(1.0, 0.5), Disturbed.PULL),
        (FORCE + 2, 0.1, 2.0, Disturbed.PULL),
    ],
)
def test_a_disturbance_is_named_from_chance_the_usual_and_what_is_worth_it(place, deviation, named_from, of):
    assert not errors({place: 0.99 * named_from}, {place: deviation}).explanations
    (found,) = errors({place: 1.02 * named_from}, {place: deviation}).explanations
    assert found.of is of
    assert found.size == pytest.approx(1.02 * named_from, rel=0.01)
    assert found.deviation == pytest.approx(deviation, rel=0.01)
    if of in {Disturbed.ZERO, Disturbed.HOSE}:
        assert found.joint == place - (ZERO if of is Disturbed.ZERO else HOSE)


def test_all_that_alone_explain_it_are_named_and_none_if_two_are_needed():
    alike = errors({ZERO + 1: 0.02}, {ZERO + 1: 0.002, HOSE + 1: 0.5}, [((ZERO + 1, HOSE + 1), 0.999)])
    assert [one.of for one in alike.explanations] == [Disturbed.ZERO, Disturbed.HOSE]
    slight = errors({ZERO + 1: 0.02}, {ZERO + 1: 0.002, FORCE: 20.0}, [((ZERO + 1, FORCE), 0.999)])
    assert [one.of for one in slight.explanations] == [Disturbed.ZERO, Disturbed.FORCE]
    unlikely = errors({ZERO + 1: 0.02}, {ZERO + 1: 0.002, FORCE: 0.15}, [((ZERO + 1, FORCE), 0.999)])
    assert [one.of for one in unlikely.explanations] == [Disturbed.ZERO], "1.5 N are not worth a word"
    both = errors({ZERO + 1: 0.02, HOSE + 4: 8.0}, {ZERO + 1: 0.002, HOSE + 4: 0.5})
    assert not both.explanations
    assert both.most_certain.of is Disturbed.HOSE
    (note,) = notes_on(both)
    assert note.startswith("The loaded run is as if a hose or cable held joint 5 back")
    assert "that alone does not explain it, the cause may be another, and the intervals may not hold." in note
    assert len(both.doubts()[0]) == JOINTS + 3


def test_doubts_are_what_rows_and_prior_leave_of_zeros_and_tilts_and_all_of_what_is_named():
    quiet = errors({}, {ZERO: 0.0005, TILT: 0.001, FORCE: 1.0})
    (torque,) = quiet.doubts()
    assert len(torque) == JOINTS + 2
    left = np.full(JOINTS + 2, 5e-4)
    left[ZERO], left[TILT] = np.sqrt(0.5) * 5e-4, 5e-4 / np.sqrt(1.25)
    np.testing.assert_allclose(torque, left[:, None, None] * quiet.torque_nm[0][: JOINTS + 2], rtol=1e-6)
    loud = errors({FORCE: 10.0}, {FORCE: 1.0})
    (torque,) = loud.doubts()
    assert len(torque) == JOINTS + 6
    np.testing.assert_allclose(torque[JOINTS + 2], (10.0 + 1.645) / 1.96 * loud.torque_nm[0][FORCE], rtol=1e-3)
    hanging = errors({FORCE + 2: 10.0}, {FORCE + 2: 1.0})
    assert len(hanging.doubts()[0]) == JOINTS + 2, "it counts as payload"
    shown = errors({ZERO: 1e-3}, {ZERO: 5e-4})
    (torque,) = shown.doubts()
    np.testing.assert_allclose(torque[0], np.sqrt(0.125e-6 + 0.25e-6) * shown.torque_nm[0][ZERO], rtol=1e-3)


def notes_on(found):
    return list(disturbance_notes(found, "the calibration"))


def test_what_a_named_disturbance_causes_is_not_read_as_zeros_once_more():
    found = errors({FORCE: 20.0}, {ZERO: 5e-4, FORCE: 1.0}, [((ZERO, FORCE), 0.9)])
    (torque,) = found.doubts()
    np.testing.assert_allclose(torque[0], np.sqrt(0.5) * 5e-4 * found.torque_nm[0][ZERO], rtol=0.05)


def test_the_deviation_of_a_force_is_that_beside_its_other_components():
    found = errors({FORCE: 20.0, FORCE + 1: 10.0}, {FORCE: 1.0, FORCE + 1: 1.0}, [((FORCE, FORCE + 1), 0.95)])
    (force,) = found.explanations
    along = np.array([2.0, 1.0]) / np.sqrt(5.0)
    information = np.array([[1.0, 0.95], [0.95, 1.0]])
    assert force.deviation == pytest.approx(np.sqrt(along @ np.linalg.inv(information) @ along), rel=0.01)
    assert len(force.reach) == 4


def test_words_name_each_disturbance_with_its_unit_and_what_to_check():
    values = {ZERO: -0.02, HOSE: 5.0}
    (note,) = notes_on(errors(values, {ZERO: 0.002, HOSE: 0.5}, [((ZERO, HOSE), -0.999)]))
    assert note.startswith("The loaded run is as if joint 1 stood 2.")
    assert "below its recorded position, or a hose or cable held joint 1 back" in note
    assert note.endswith("Check the joint's zero (a gear that gives way looks the same) and hoses.")
    assert not list(disturbance_notes(errors({}, {}), "the calibration"))
    for newton, way in ((8.0, "down"), (-8.0, "up")):
        (note,) = notes_on(errors({FORCE + 2: newton}, {FORCE + 2: 1.0}))
        assert f"a force of 8.0 +- 2.0 N pulled the flange {way}. The mass may be 0.82 kg too" in note
        assert ("kg too great by" if newton > 0.0 else "kg too small by") in note
        assert "allow for that" not in note
        assert note.endswith("Check the clock (a wrong one looks like a vertical force).")
    (note,) = notes_on(errors({FORCE: 8.0}, {FORCE: 1.0}))
    assert "pulled at the flange (base frame: " in note
    assert "8.0, " in note
    (note,) = notes_on(errors({TILT: 0.02}, {TILT: 0.001}))
    assert "the base had tilted by 1.15 +- 0.11 deg since the calibration; the intervals allow for that alone. " in note


@pytest.mark.parametrize("factor", [0.99, 1.1])
def test_a_drift_that_the_calibration_leaves_possible_is_no_disturbance(pair, calibration, pinocchio_arm, factor):
    """Gains that have drifted together since then look like a joint's zero or a force."""
    arm, chain = calibration.known_arm, calibration.level(pinocchio_arm.chain)
    transmission = calibration.transmission(pinocchio_arm.transmission)
    run = Run.of(replace(pair[0], current_a=factor * pair[0].current_a), transmission)
    posterior = solve(single_problem(run.over_time, chain, transmission.coupling, arm).problem, rough=True)
    drift = 0.03 * (np.arange(arm.errors.shape[1]) < chain.n)
    found = [Disturbances.of(posterior, chain, arm.body, errors) for errors in (None, np.vstack([arm.errors, drift]))]
    exact, known = (max(map(one.certainty, one.candidates)) for one in found)
    assert known < 0.6 * exact


@pytest.mark.parametrize("runs", [1, 2])
def test_every_look_at_a_calibrated_arm_knows_its_errors(pair, calibration, pinocchio_arm, monkeypatch, runs):
    """Also those at what is left without a likely disturbance."""
    look, seen = Disturbances._of_solution, []
    monkeypatch.setattr(
        Disturbances,
        "_of_solution",
        staticmethod(lambda found, **arm: seen.append(arm["errors"]) or look(found, **arm)),
    )
    given = [turned(run, 3, 1.0) for run in pair[:runs]] + [None] * (2 - runs)
    chain, transmission = calibration.level(pinocchio_arm.chain), calibration.transmission(pinocchio_arm.transmission)
    identify_runs(*given, chain, transmission, arm=calibration.known_arm)
    assert len(seen) > 1
    assert all(np.array_equal(errors, calibration.known_arm.errors) for errors in seen)
