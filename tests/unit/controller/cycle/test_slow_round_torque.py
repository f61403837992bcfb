"""What the torque of a slow round shows, on Pinocchio's arm: scale and zero of a joint, and the mass on the flange."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.cycle.slow_round_torque import Mass, SlowRoundRows, SlowRoundTorque
from armload_controller.motion.phase import Segment
from armload_identification.signals.joint_torque import joint_torque

AVERAGED_S = 0.1

NAMES = tuple("abcdef")
TORQUE_MAX_NM = np.full(6, 200.0)
RATE = 10.0
GIVEN = np.full(6, 0.02)


@pytest.fixture(scope="module")
def slow(pinocchio_arm):
    """Position and torque of a slow round, with or without the payload, averaged."""
    trajectory = pinocchio_arm.trajectory()

    def slow(loaded, seed=1):
        run = pinocchio_arm.run(
            trajectory,
            loaded,
            seed=seed,
            periods=1,
            cycle_s=AVERAGED_S / RATE,
            noise=0.3,
            rate=RATE,
            load_friction=0.05,
        )
        return run.position_rad, joint_torque(run, pinocchio_arm.transmission)

    return slow


def fitted(arm, slow, factor=1.0, zero=0.0):
    position, torque = slow
    return SlowRoundTorque(NAMES, arm.chain, position, torque * factor + zero)


def of(joint, value, otherwise):
    """Values of all joints, one of them different."""
    values = np.full(6, otherwise)
    values[joint] = value
    return values


@pytest.mark.parametrize("loaded", [False, True])
def test_an_arm_without_faults_causes_no_doubts(pinocchio_arm, slow, loaded):
    assert fitted(pinocchio_arm, slow(loaded)).doubts(TORQUE_MAX_NM) == []


@pytest.mark.parametrize("factor", [0.33, 3.0])
@pytest.mark.parametrize("joint", [1, 2, 3, 5])
def test_the_joint_whose_scale_is_wrong_is_named_with_its_factor(pinocchio_arm, slow, joint, factor):
    (text,) = fitted(pinocchio_arm, slow(True), of(joint, factor, 1.0)).doubts(TORQUE_MAX_NM)
    assert text.startswith("the joints' torques contradict each other: ")
    found = dict(part.split("'s is ") for part in text.split(": ")[1].split(". Check")[0].split(", or "))
    assert float(found[NAMES[joint]].split(" times")[0]) == pytest.approx(factor, rel=0.25)


def test_a_joint_on_a_vertical_axis_shows_no_scale(pinocchio_arm, slow):
    assert fitted(pinocchio_arm, slow(True), of(0, 3.0, 1.0)).doubts(TORQUE_MAX_NM) == []


@pytest.mark.parametrize("joint", [0, 4, 5])
def test_a_wrong_zero_is_found_with_its_value(pinocchio_arm, slow, joint):
    (text,) = fitted(pinocchio_arm, slow(True), zero=of(joint, -18.0, 0.0)).doubts(TORQUE_MAX_NM)
    assert text.startswith(f"{NAMES[joint]}: its torque is -1")
    assert "N m off zero" in text


def arm_alone(arm, position):
    """(N, n) torque of the empty arm at rest, by Pinocchio."""
    model = arm._model(None)
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, q) for q in position])


@pytest.mark.parametrize(("errors", "said"), [(7.5, False), (8.5, True)])
def test_a_zero_is_doubted_from_eight_standard_errors_beyond_a_twentieth_of_the_limit(
    pinocchio_arm, slow, errors, said
):
    """Friction that grows with load looks like a zero of up to six and a half."""
    found = fitted(pinocchio_arm, slow(True))
    found.zero[1] = -(0.05 * TORQUE_MAX_NM[1] + errors * 3.0), 3.0
    assert any("off zero" in text for text in found.doubts(TORQUE_MAX_NM)) is said


@pytest.mark.parametrize("loaded", [False, True])
def test_the_mass_on_the_flange_is_found_beside_the_arms_own_torque(pinocchio_arm, slow, loaded):
    seen = fitted(pinocchio_arm, slow(loaded))
    mass = seen.carried(arm_alone(pinocchio_arm, seen.position_rad), GIVEN)
    assert mass.kg == pytest.approx(pinocchio_arm.payload.mass_kg * loaded, abs=3.0 * mass.error_kg)
    assert mass.error_kg < 0.2
    assert mass.greatest_kg == pytest.approx(max(0.0, mass.kg) + 4.0 * mass.error_kg)


def test_an_arm_known_less_well_leaves_the_mass_less_certain(pinocchio_arm, slow):
    seen = fitted(pinocchio_arm, slow(True))
    own = arm_alone(pinocchio_arm, seen.position_rad)
    exact, wrong = seen.carried(own, GIVEN), seen.carried(1.1 * own, np.full(6, 0.1))
    assert wrong.error_kg > 1.5 * exact.error_kg
    assert wrong.kg == pytest.approx(pinocchio_arm.payload.mass_kg, abs=3.0 * wrong.error_kg)


@pytest.mark.parametrize("loaded", [False, True])
def test_the_mass_added_since_an_earlier_slow_round_needs_no_model_of_the_links(pinocchio_arm, slow, loaded):
    before, now = fitted(pinocchio_arm, slow(False)), fitted(pinocchio_arm, slow(loaded, seed=2))
    mass = now.added_since(before)
    assert mass.kg == pytest.approx(pinocchio_arm.payload.mass_kg * loaded, abs=3.0 * mass.error_kg)
    assert mass.error_kg < 0.1


@pytest.mark.parametrize("as_torque", [False, True])
def test_rows_are_averaged_and_converted(pinocchio_arm, slow, as_torque):
    position, torque = slow(True)
    arm, cycles = pinocchio_arm, 4
    gains = replace(arm.transmission, torque_gain=np.full(6, 2.0))
    rows = SlowRoundRows(AVERAGED_S / cycles)
    for q, tau in zip(position, torque, strict=True):
        current = arm.transmission.coupling.T @ tau / arm.transmission.gain_nm_a
        for shift in (-0.3, -0.1, 0.1, 0.3):
            rows.add(
                q + shift, 0.5 * (tau + shift) if as_torque else None, None if as_torque else current * (1.0 + shift)
            )
    found = rows.fitted(NAMES, arm.chain, gains)
    np.testing.assert_allclose(found.position_rad, position, atol=1e-12)
    assert found.zero[4] == pytest.approx(fitted(arm, (position, torque)).zero[4], rel=1e-6)


def test_too_few_rows_and_rows_without_torque_show_nothing(pinocchio_arm):
    rows = SlowRoundRows(AVERAGED_S)
    for _ in range(35):
        rows.add(np.linspace(0.0, 1.0, 6), np.ones(6), None)
    for _ in range(1000):
        rows.add(np.zeros(6), None, None)
    assert rows.fitted(NAMES, pinocchio_arm.chain, pinocchio_arm.transmission) is None


def test_a_slow_round_in_which_no_joint_moves_shows_nothing(pinocchio_arm):
    rows = SlowRoundRows(AVERAGED_S)
    for _ in range(100):
        rows.add(np.zeros(6), np.ones(6), None)
    assert rows.fitted(NAMES, pinocchio_arm.chain, pinocchio_arm.transmission) is None


def test_only_rows_of_a_slow_round_with_an_effort_are_kept(pinocchio_arm):
    """Averaged over 0.1 s: ten rows each; 36 averages are six for each of six joints."""
    position = np.arange(6.0)
    rows = SlowRoundRows(0.01)

    def step(segment, torque_nm=None, current_a=None):
        reference = None if segment is None else SimpleNamespace(segment=segment)
        feedback = SimpleNamespace(position_rad=position, torque_nm=torque_nm, current_a=current_a)
        return SimpleNamespace(sent_reference=reference, feedback=feedback)

    for skipped in (step(None, position), step(Segment.PERIODS, position), step(Segment.SLOW)):
        rows.on_cycle(skipped)
    assert rows._positions == []
    rows.on_cycle(step(Segment.SLOW, current_a=position))
    assert (len(rows._positions), rows._is_torque) == (1, False)
    rows.on_cycle(step(Segment.SLOW, position, position))
    assert (len(rows._positions), rows._is_torque) == (2, True)


@pytest.mark.parametrize(("count", "enough"), [(359, False), (360, True)])
def test_a_fit_needs_six_averaged_rows_for_each_joint(pinocchio_arm, count, enough):
    rng, rows = np.random.default_rng(3), SlowRoundRows(0.01)
    for row in range(count):
        phase = 2.0 * np.pi * row / 90.0
        rows.add(0.5 * np.sin(phase + np.arange(6.0)), 5.0 * np.cos(phase + np.arange(6.0)) + rng.normal(size=6), None)
    assert (rows.fitted(NAMES, pinocchio_arm.chain, pinocchio_arm.transmission) is not None) is enough


def test_joints_that_stand_are_no_slow_round(pinocchio_arm):
    """Of 0.2 rad of travel at least."""
    for travel_rad, found in ((0.19, False), (0.21, True)):
        rows = SlowRoundRows(0.1)
        for row in range(36):
            moved = np.where(np.arange(6) == 2, travel_rad * row / 35.0, 0.0)
            rows.add(moved, np.full(6, 5.0) + 0.1 * row, None)
        fit = rows.fitted(NAMES, pinocchio_arm.chain, pinocchio_arm.transmission)
        assert (fit is not None) is found
        if found:
            assert fit.moved.tolist() == [2]


def test_a_mass_may_be_four_standard_errors_greater_and_is_never_less_than_nothing():
    assert Mass(2.0, 0.25).greatest_kg == pytest.approx(3.0)
    assert Mass(-2.0, 0.25).greatest_kg == pytest.approx(1.0)
