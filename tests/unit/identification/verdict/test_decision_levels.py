"""The probability of false alarms, divided among several tests, and each level by what turns at it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t

from armload_identification.identification_errors import IdentificationError
from armload_identification.model.joint_states import JointStates
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.operator_notes import (
    _by_how_much,
    _on_arm,
    _on_calibrated_arm,
    _on_contradictions,
    _on_signal,
    _on_times,
    misfit_notes,
)
from armload_identification.signals.motion import ABOVE_BAND
from armload_identification.verdict.agreement import (
    KnownMassCenter,
    _difference_covariance,
    compare_known,
    length_needed,
)
from armload_identification.verdict.control_limits import control_chart
from armload_identification.verdict.decision_levels import FalseAlarms
from armload_identification.verdict.recording_checks.column_mistakes import (
    RunColumns,
    _Correction,
    _Exchange,
    exchanged_columns,
    flipped_signs,
)
from armload_identification.verdict.recording_checks.friction_validity import friction_notes, standard_deviations
from armload_identification.verdict.recording_checks.impossible_magnitudes import (
    ArmMagnitudes,
    _refuse_positions,
    _refuse_scale,
    _refuse_speeds,
    _refuse_strength,
    require_possible_mass,
    scale_notes,
)
from armload_identification.verdict.recording_checks.joint_scales import JointScales
from armload_identification.verdict.recording_checks.motion_quality import MotionQuality
from armload_identification.verdict.recording_checks.nothing_mounted import refuse_nothing
from armload_identification.verdict.recording_checks.pair_contradictions import (
    _is_evidence,
    _refuse_contradicting_joint,
    _refuse_impossible_gain,
    _refuse_no_mass,
    _refuse_opposite,
    _refuse_small,
    check_scales,
)
from armload_identification.verdict.recording_checks.usable_runs import (
    _refuse_fed_energy,
    _refuse_long_means,
    _refuse_saturation,
    _refuse_stuck,
    _refuse_velocity,
    _refuse_velocity_as_effort,
)
from armload_identification.verdict.tolerance import Tolerance

pytestmark = pytest.mark.pure

CHECKS = "armload_identification.verdict.recording_checks"


@pytest.mark.parametrize("tests", [1, 6, 24])
def test_the_greatest_of_several_sound_values_exceeds_its_limit_with_the_stated_probability(tests):
    greatest = np.abs(np.random.default_rng(0).normal(size=(40_000, tests))).max(axis=1)
    alarms = np.mean(greatest > FalseAlarms.deviations(tests))
    assert alarms == pytest.approx(FalseAlarms.probability, abs=0.0015)


# Comparisons -----------------------------------------------------------------------------------------------------


def known(variance=0.0, freedom=np.inf, mass_kg=10.0):
    """A payload whose mass and centre have the same variance, each in units of its floor."""
    body = InertialParameters.from_center_of_mass(mass_kg, [0.0, 0.0, 0.1], 0.05 * np.eye(3))
    covariance = variance * np.diag([25.0, 1.0, 1.0, 1.0]) * 1e-6
    return KnownMassCenter(body, MassCenterCovariance(covariance, freedom))


def test_what_is_known_exactly_agrees_to_5_g_and_1_mm():
    found = compare_known(known(), known(), Tolerance())
    np.testing.assert_allclose(found.half_width_95, 1.959964 * np.array([0.005, 0.001, 0.001, 0.001]), rtol=1e-5)


@pytest.mark.parametrize(("mass_kg", "outcome"), [(10.18, "right"), (10.22, "wrong")])
def test_two_percent_of_the_mass_is_tolerated(mass_kg, outcome):
    assert compare_known(known(), known(mass_kg=mass_kg), Tolerance()).outcome == outcome
    assert (Tolerance().mass_share, Tolerance().center_m) == (0.02, 0.01)


@pytest.mark.parametrize(("freedom", "critical"), [(1.5, 99.25), (2.5, 99.25), (3.5, 15.977), (6.5, 5.994)])
def test_f_has_the_freedom_of_both_less_three_and_at_least_two(freedom, critical):
    """Two equal covariances have twice the freedom of one: F of 4 and 2, 2, 4 and 10 - by a table at 1 %."""
    one = known(1e6, freedom)
    found = compare_known(one, one, Tolerance(0.9, 0.9))
    both = _difference_covariance(one.covariance, one.covariance, np.zeros((4, 4)))
    assert both[1] == pytest.approx(2.0 * freedom, rel=1e-4)
    assert found.critical == pytest.approx(critical, rel=1e-3)


@pytest.mark.parametrize(("longer", "found"), [(1.0001, 1.0), (900.0, 900.0), (1100.0, np.inf)])
def test_runs_longer_than_a_thousand_times_do_not_help(longer, found):
    size = compare_known(known(), known(), Tolerance()).noticeable_kg / 0.005
    variance = longer * ((0.2 / size) ** 2 / 0.005**2 - 1.0)
    needed = length_needed(known(variance), known(), Tolerance(0.02, 0.9))
    assert needed.factor == pytest.approx(found, rel=2e-3)
    assert not needed.gains_limit


# Charts ----------------------------------------------------------------------------------------------------------


def chart(values, charts=18):
    nothing = np.zeros(len(values))
    return control_chart(np.array(values, dtype=float), nothing, nothing, 1.0, charts)


def test_a_jump_counts_in_the_spread_as_nine_times_the_median_variance():
    """Ten differences of 1, of which one is 101: 9 / 0.6745 squared, 19.78, in its place."""
    found = chart([0, 1, 0, 1, 0, 101, 100, 101, 100, 101, 100])
    expected = np.sqrt((5.0 + 10.0 * 0.5 * (9.0 + 19.783) / 10.0) / 15.0)
    np.testing.assert_allclose(found.limit, 3.0 * expected, rtol=1e-4)


@pytest.mark.parametrize(("off", "alone"), [(0.99, []), (1.01, [5])])
@pytest.mark.parametrize(("runs", "charts"), [(12, 18), (30, 1)])
def test_an_outlier_is_what_of_four_tests_a_run_one_report_in_a_hundred_has(runs, charts, off, alone):
    """The spread is that of five expected runs; Student's t has their freedom and two thirds of a run for each step."""
    bound = t.isf(0.01 / (4 * charts * runs), 5.0 + 2.0 / 3.0 * (runs - 1))
    values = np.zeros(runs)
    values[5] = off * bound * np.sqrt(2.0 * 5.0 / (5.0 + runs - 1))
    assert np.flatnonzero(chart(values, charts).alone).tolist() == alone


def test_two_runs_are_a_level_and_one_is_an_outlier():
    assert [change.index for change in chart([0.0] * 8 + [20.0] * 2).changes] == [8]
    one = chart([0.0] * 8 + [20.0])
    assert (one.changes, np.flatnonzero(one.alone).tolist()) == ((), [8])


# Recordings that cannot be used ----------------------------------------------------------------------------------


def refusal(check, *given):
    """What a check says, nothing if it passes."""
    try:
        check(*given)
    except IdentificationError as error:
        return str(error)
    return ""


TIME_S = 0.01 * np.arange(4001)
SWING, TURNED = np.sin(0.5 * np.pi * TIME_S)[:, None], np.cos(0.5 * np.pi * TIME_S)[:, None]
SPEED, TURNED_SPEED = 0.5 * np.pi * TURNED, -0.5 * np.pi * SWING


def run_of(position, **changes):
    """A run of 40 s, ten swings, with rows (N, n)."""
    rows = dict.fromkeys(("velocity_rad_s", "average", "torque_nm", "current_a", "phase_s", "repeats", "excitation"))
    rows |= {"time_s": TIME_S, "position_rad": position, "source": SimpleNamespace(path="run")}
    return SimpleNamespace(recording=SimpleNamespace(**(rows | changes)))


def turned_by(degrees):
    """A speed whose correlation with the swing's is the cosine of an angle."""
    return np.cos(np.radians(degrees)) * SPEED + np.sin(np.radians(degrees)) * TURNED_SPEED


@pytest.mark.parametrize(
    ("velocity", "said"),
    [
        (turned_by(59.0), ""),
        (turned_by(61.0), "the velocity of joint 1 is not the derivative"),
        (turned_by(25.0) * 180.0 / np.pi, "Its velocities look like degrees"),
        (turned_by(27.0) * 180.0 / np.pi, ""),
        (turned_by(25.0) * np.pi / 180.0, "Its positions look like degrees"),
        (SPEED * 180.0 / np.pi * np.exp(0.19), "Its velocities look like degrees"),
        (SPEED * 180.0 / np.pi * np.exp(0.21), ""),
        (SPEED * 180.0 / np.pi * np.exp(-0.21), ""),
    ],
)
def test_a_velocity_correlates_with_the_motion_by_half_and_in_degrees_by_nine_tenths(velocity, said):
    found = refusal(_refuse_velocity, run_of(SWING, velocity_rad_s=velocity))
    assert said in found
    assert bool(said) is bool(found)


@pytest.mark.parametrize(("gap", "said"), [(4.9, True), (5.1, False)])
def test_what_moves_in_a_gap_of_five_samples_is_not_compared_with_its_velocity(gap, said):
    time_s = TIME_S + 0.01 * (gap - 1.0) * (np.arange(4001) > 2000)
    rows = run_of(SWING + 50.0 * (np.arange(4001) > 2000)[:, None], velocity_rad_s=SPEED, time_s=time_s)
    assert bool(refusal(_refuse_velocity, rows)) is said


@pytest.mark.parametrize(("degrees", "said"), [(8.0, True), (8.3, False)])
def test_a_current_that_is_a_velocity_correlates_by_0_99_on_every_moving_joint(degrees, said):
    both, current = np.hstack([SWING, SWING]), np.hstack([3.0 * SPEED, 2.0 * turned_by(degrees)])
    found = refusal(_refuse_velocity_as_effort, run_of(both, current_a=current, effort=current))
    assert bool(found) is said
    one = run_of(np.hstack([SWING, 0.0 * SWING]), current_a=current, effort=current)
    assert not refusal(_refuse_velocity_as_effort, one), "a single moving joint"


@pytest.mark.parametrize(("hz", "said"), [(0.19, False), (0.205, True)])
def test_means_of_long_runs_cost_a_hundredth_of_the_amplitude_at_most(hz, said):
    """(pi f T)^2 / 6 for means over 0.4 s is a hundredth at 0.195 Hz."""
    time_s = 0.4 * np.arange(4001)
    rows = run_of(np.sin(2.0 * np.pi * hz * time_s)[:, None], time_s=time_s, repeats=True)
    assert bool(refusal(_refuse_long_means, rows)) is said


@pytest.mark.parametrize(
    ("at_bound", "elsewhere", "travel_rad", "said"),
    [
        (6, 0, 1.0, False),
        (7, 0, 1.0, True),
        (8, 3, 1.0, False),
        (9, 3, 1.0, True),
        (9, 0, 0.049, False),
        (9, 0, 0.051, True),
    ],
)
def test_a_torque_at_its_bound_for_long_is_saturated(at_bound, elsewhere, travel_rad, said):
    """Eight equal samples are seven repetitions, and three times as many as of any other value."""
    repeats = SimpleNamespace(at_bound=np.array([at_bound]), elsewhere=np.array([elsewhere]), bound=np.array([4.5]))
    found = refusal(
        _refuse_saturation,
        SimpleNamespace(recording=run_of(0.5 * travel_rad * SWING).recording, repeats=repeats),
    )
    assert (f"at its maximum of 4.5 for {at_bound + 1} samples in a row" in found) is said


@pytest.mark.parametrize(
    ("turned_rad", "travel_rad", "said"),
    [(0.051, 0.4, True), (0.049, 0.4, False), (0.099, 1.0, False), (0.101, 1.0, True)],
)
def test_a_torque_that_stays_while_a_joint_turns_back_by_a_tenth_of_its_range_is_stuck(turned_rad, travel_rad, said):
    repeats = SimpleNamespace(turned_rad=np.array([turned_rad]), turned_at=np.array([1.0]), turned_for=np.array([30.0]))
    one = SimpleNamespace(recording=run_of(0.5 * travel_rad * SWING).recording, repeats=repeats)
    assert ("joint 1 moves back and forth" in refusal(_refuse_stuck, one)) is said


@pytest.mark.parametrize(
    ("ratio", "end_rad", "said"), [(-0.029, 0.0, False), (-0.031, 0.0, True), (-0.5, 0.049, True), (-0.5, 0.051, False)]
)
def test_friction_leaves_no_work_of_minus_3_percent_over_a_closed_motion(ratio, end_rad, said):
    """A torque of 1 + r against one motion and 1 - r with the other."""
    position = SWING + end_rad * np.linspace(0.0, 1.0, 4001)[:, None]
    torque = np.where(SPEED > 0.0, 1.0 + ratio, 1.0 - ratio)
    found = refusal(_refuse_fed_energy, SimpleNamespace(recording=run_of(position).recording, torque_nm=torque))
    assert ("the motors of joint 1 absorb energy" in found) is said


# Magnitudes ------------------------------------------------------------------------------------------------------


def magnitudes(least=-1.0, greatest=1.0, speed=1.0, torque=10.0, body=None):
    both = [np.full(2, value) for value in (least, greatest, speed, torque)]
    return ArmMagnitudes(("elbow", "wrist"), *both, body)


def recorded(position, time_s=TIME_S):
    return SimpleNamespace(
        position_rad=position, time_s=time_s[: len(position)], size=len(position), source=SimpleNamespace(path="run")
    )


@pytest.mark.parametrize(
    ("low", "high", "arm", "said"),
    [
        (-0.2, 1.19, {}, ""),
        (-0.2, 1.21, {}, "Is this a recording of another arm"),
        (-1.21, 0.2, {}, "goes from -1.21 to 0.2, its range is -1 to 1 rad. Is this"),
        (0.0, 3.59, {"least": -3.0, "greatest": 3.0}, ""),
        (0.0, 3.61, {"least": -3.0, "greatest": 3.0}, "another arm"),
        (0.0, 0.61, {"least": -0.2, "greatest": 0.2}, "look like degrees"),
        (0.0, 0.59, {"least": -0.2, "greatest": 0.2}, "another arm"),
        (-0.31, 0.31, {"least": 0.0, "greatest": 0.2}, "look like degrees"),
        (-0.29, 0.29, {"least": 0.0, "greatest": 0.2}, "another arm"),
        (0.0, 68.0, {}, "look like degrees"),
        (0.0, 69.3, {}, "another arm"),
    ],
)
def test_positions_stay_within_their_range_and_0_2_rad_or_a_tenth_and_three_times_it_is_in_degrees(
    low, high, arm, said
):
    position = np.tile(np.linspace(low, high, 400)[:, None], 2)
    found = refusal(_refuse_positions, recorded(position), position, magnitudes(**arm))
    assert said in found
    assert bool(said) is bool(found)


@pytest.mark.parametrize(
    ("first", "second", "said"), [(3.1, 1.19, True), (2.9, 1.19, False), (3.1, 1.21, False), (3.1, np.nan, False)]
)
def test_a_joint_three_times_as_fast_as_possible_is_in_degrees_if_no_other_is_too_fast(first, second, said):
    position = TIME_S[:400, None] * np.array([first, second])
    found = refusal(_refuse_speeds, recorded(position), magnitudes())
    assert ("elbow reaches 3.1 rad/s, 3.1 times" in found) is said


def test_speeds_are_taken_over_a_tenth_of_a_second_and_a_hundredth_of_the_samples_does_not_count():
    """To and fro within 0.2 s is fast, within 0.1 s an encoder's noise."""
    for period_s, said in ((0.2, True), (0.1, False)):
        wave = 3.6 * np.abs((TIME_S[:400] + 1e-9) % period_s - 0.5 * period_s)
        position = np.column_stack([wave, 0.0 * wave])
        assert bool(refusal(_refuse_speeds, recorded(position), magnitudes())) is said


@pytest.mark.parametrize(
    ("times", "rows", "said"), [(20.1, 400, True), (19.9, 400, False), (99.0, 3, False), (99.0, 6, True)]
)
def test_twenty_times_its_greatest_torque_no_joint_has_in_more_than_a_hundredth_of_the_samples(times, rows, said):
    torque = np.zeros((400, 2))
    torque[:rows, 1] = -10.0 * times
    found = refusal(_refuse_strength, recorded(torque), torque, magnitudes())
    assert ("wrist reaches" in found) is said


@pytest.mark.parametrize(
    ("scale", "correlation", "joint", "said"),
    [
        (0.099, 1.0, 0, "those of the motors"),
        (0.101, 1.0, 0, ""),
        (10.1, 1.0, 0, "Is this a recording of this arm"),
        (9.9, 1.0, 0, ""),
        (340.0, 1.0, 0, "like N mm"),
        (325.0, 1.0, 0, "Is this a recording"),
        (2950.0, 1.0, 0, "like N mm"),
        (3050.0, 1.0, 0, "Is this a recording"),
        (1000.0, 0.61, 0, "elbow is 1e+03 times"),
        (1000.0, 0.59, 0, ""),
        (1000.0, 0.91, 1, "wrist is 1e+03 times"),
        (1000.0, 0.89, 1, ""),
    ],
)
def test_a_torque_that_resembles_the_links_weight_has_a_tenth_to_ten_times_its_size(
    monkeypatch, scale, correlation, joint, said
):
    """The most loaded joint by 0.6, others by 0.9."""
    links = SimpleNamespace(torque=lambda q, *_: q * np.array([8.0, 4.0]))
    monkeypatch.setattr(f"{CHECKS}.impossible_magnitudes.ArmDynamics", lambda *_: links)
    position = np.hstack([SWING, SWING])
    torque = position * np.array([8.0, 4.0])
    other = np.sqrt(1.0 - correlation**2) / correlation * 2.0 * SWING * TURNED
    torque[:, [joint]] = scale * (torque[:, [joint]] + [8.0, 4.0][joint] * other)
    given = recorded(position), position, torque, None, magnitudes(torque=np.nan, body=object())
    found = refusal(_refuse_scale, *given)
    assert said in found
    assert bool(said) is bool(found)


@pytest.mark.parametrize(("friction_nm", "scale", "said"), [(16.0, 1.0, ""), (16.0, 1.5, "1.5 times"), (0.0, 1.3, "")])
def test_friction_that_resembles_the_links_weight_is_no_scale(monkeypatch, friction_nm, scale, said):
    """Three quarters of an oscillation: upward motion is only above its middle."""
    links = SimpleNamespace(torque=lambda q, *_: 8.0 * q)
    monkeypatch.setattr(f"{CHECKS}.impossible_magnitudes.ArmDynamics", lambda *_: links)
    part = TIME_S < 3.0
    torque = scale * 8.0 * SWING[part] + friction_nm * np.sign(TURNED[part])
    run = SimpleNamespace(states=SimpleNamespace(position_rad=SWING[part]), torque_nm=torque)
    notes = list(scale_notes(run, None, magnitudes(torque=np.nan, body=object())))
    assert bool(notes) is bool(said)
    assert said in "".join(notes)


@pytest.mark.parametrize(("strength", "said"), [(0.9, True), (1.1, False)])
def test_a_weight_of_2_percent_of_the_greatest_torque_is_visible(monkeypatch, strength, said):
    links = SimpleNamespace(torque=lambda q, *_: q)
    monkeypatch.setattr(f"{CHECKS}.impossible_magnitudes.ArmDynamics", lambda *_: links)
    position = np.hstack([SWING, SWING])
    arm = magnitudes(torque=strength * np.sqrt(0.5) / 0.02, body=object())
    given = recorded(position), position, 100.0 * position, None, arm
    assert bool(refusal(_refuse_scale, *given)) is said


@pytest.mark.parametrize(
    ("interval_kg", "said"),
    [((37.6, 80.0), "times"), ((37.4, 80.0), ""), ((0.001, 0.0124), "% of"), ((0.001, 0.0126), "")],
)
def test_a_mass_is_from_a_thousandth_to_three_times_the_rated_payload(interval_kg, said):
    found = refusal(require_possible_mass, 1.0, np.array(interval_kg), 12.5, "arm")
    assert said in found
    assert bool(said) is bool(found)


# Motion, friction and scales -------------------------------------------------------------------------------------


def quality(*moving_s, brisk=0.3):
    return MotionQuality(np.array(moving_s), np.full(len(moving_s), brisk))


def test_five_seconds_of_every_joint_are_enough_and_a_second_of_two_is_required():
    assert quality(5.0, 5.1, 9.0).missing == ""
    assert quality(5.0, 4.9, 9.0, brisk=0.21).missing == "move joint 2 at 0.21 rad/s for 10 s"
    assert not refusal(quality(1.0, 1.0, 0.0).require_enough, "run")
    assert "run: only joint 2 moves" in refusal(quality(0.99, 1.0, 0.0).require_enough, "run")
    assert "run: the arm is at rest" in refusal(quality(0.99, 0.9, 0.0).require_enough, "run")
    assert not refusal(quality(1.0).require_enough, "run"), "an arm of one joint"


@pytest.mark.parametrize(
    ("reversal_rad_s", "moving_s", "brisk_rad_s"), [(0.004, 6.0, 0.2), (0.009, 2.0, 0.3), (0.006, 2.0, 0.3)]
)
def test_a_joint_moves_at_ten_times_the_speed_of_its_reversals(reversal_rad_s, moving_s, brisk_rad_s):
    """0.05 rad/s for 2 s and 0.1 rad/s for 1 s, of two periods; brisk is half of a hundred times, at most 0.3."""
    speed = np.repeat([0.0, 0.05, 0.1], [10, 20, 10])[:, None]
    motion = SimpleNamespace(
        states=SimpleNamespace(velocity_rad_s=-speed), valid=np.ones(40, dtype=bool), interval_s=0.1, periods=2
    )
    found = MotionQuality.of(motion, SimpleNamespace(reversal_speed_rad_s=np.array([reversal_rad_s])))
    assert found.moving_s == pytest.approx([moving_s])
    assert found.brisk_rad_s == pytest.approx([brisk_rad_s])


def test_a_mass_that_the_motion_does_not_show_has_its_likeliest_cause():
    assert "is negative, -0.3 kg +- 0.2 kg" in str(quality(9.0).undetermined("run", -0.3, 0.2))
    light = str(quality(9.0).undetermined("run", 0.3, 0.2))
    assert "the payload is light for this arm, or the motion is insufficient: record a longer run" in light
    nothing = quality(1.0).undetermined("run", 0.1, 0.2)
    assert "nothing is mounted, or the motion is insufficient: move joint 1" in str(nothing)
    assert (nothing.mass_kg, nothing.half_width_kg) == (0.1, 0.2)


def test_friction_is_far_off_beyond_five_deviations_of_drift_and_fit():
    assert list(friction_notes(np.array([5.0, 0.0]))) == []
    assert "The friction of joint 2 (5 standard deviations)" in next(friction_notes(np.array([4.9, 5.1])))
    deviations = standard_deviations(np.array([[2.0], [0.0]]), np.diag([0.64, 1.0])[None], np.array([[0.6], [1.0]]))
    assert deviations == pytest.approx([2.0])


@pytest.mark.parametrize(
    ("mass_kg", "center_kg_m", "own_nm", "nothing"),
    [
        (0.1, 0.0, 74.0, True),
        (0.1, 0.0, 73.0, False),
        (-0.39, 0.0, 500.0, True),
        (-0.40, 0.0, 500.0, False),
        (0.1, 0.0390, 500.0, True),
        (0.1, 0.0395, 500.0, False),
    ],
)
def test_nothing_is_mounted_if_at_most_4_percent_of_the_arms_own_torque_is_left(mass_kg, center_kg_m, own_nm, nothing):
    """10 N m per kg, and 0.296 kg at most; of negative masses and of moments two half widths."""
    variance = np.array([0.1, 0.01, 0.01, 0.01]) ** 2
    theta = np.array([mass_kg, center_kg_m, *np.zeros(8)])
    nothing_left = SimpleNamespace(residual_nm=np.zeros((1, 1)))
    plain = SimpleNamespace(theta=theta, spread=lambda _: (variance, np.full(4, 1e6)), posterior=nothing_left)
    regressor, arm_nm = np.zeros((9, 1, 10)), np.full((9, 1), own_nm)
    regressor[..., 0] = 10.0
    assert bool(refusal(refuse_nothing, plain, regressor, arm_nm)) is nothing


def test_a_scale_is_determined_to_5_percent_and_disagrees_by_one_or_beyond_chance():
    """Of six joints, one of a hundred has 3.14 deviations, 1.6 half widths."""
    widths = np.array([0.049, 0.051, 0.001, 0.001, 0.04, 0.04])
    found = JointScales(np.array([1.5, 1.5, 1.011, 0.991, 1.066, 0.937]), widths)
    assert found.determined.tolist() == [True, False, True, True, True, True]
    assert found.disagree.tolist() == [True, False, True, False, True, False]


# Joints that contradict ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scale", "half_width", "payload_nm", "moves", "said"),
    [
        (3.3, 0.1, 5.0, True, True),
        (3.1, 0.1, 5.0, True, False),
        (0.1, 0.1, 5.0, True, True),
        (0.1, 0.12, 5.0, True, False),
        (3.3, 0.1, 0.51, True, True),
        (3.3, 0.1, 0.49, True, False),
        (3.3, 0.1, 5.0, False, False),
        (np.nan, np.inf, 5.0, True, False),
    ],
)
def test_a_torque_beyond_three_times_the_payloads_by_two_half_widths_contradicts_it(
    scale, half_width, payload_nm, moves, said
):
    """On a joint with at least a tenth of its 5 N m of friction."""
    scales = JointScales(np.array([1.0, scale, 1.0]), np.array([0.01, half_width, 0.01]))
    given = scales, np.array([9.0, payload_nm, 9.0]), np.full(3, 5.0), np.array([True, moves, True])
    found = refusal(check_scales, *given)
    assert ("the torque of joint 2 contradicts the payload" in found) is said
    assert ("reports a small part of its torque" in found) is (said and scale > 1.0)


def test_a_joint_that_alone_determines_the_payload_is_blamed_and_not_the_others():
    scales = JointScales(np.array([4.0, 1.0, 5.0]), np.full(3, 0.01))
    found = refusal(check_scales, scales, np.full(3, 9.0), np.ones(3), np.ones(3, dtype=bool))
    assert "the torque of joint 2 contradicts" in found
    assert "small part" not in found


@pytest.mark.parametrize(
    ("scale", "half_width", "fitted", "said"),
    [
        (0.13, 0.1, True, "more than a factor of 3"),
        (0.14, 0.1, True, ""),
        (0.14, 0.1, False, "joint 2 measures 0.14 +- 0.10"),
        (0.54, 0.1, False, "joint 2 measures 0.54"),
        (0.56, 0.1, False, ""),
    ],
)
def test_a_small_share_is_refused_below_a_third_or_without_gains_below_three_quarters(scale, half_width, fitted, said):
    """Only the joint that is off most in half widths is judged, and none whose share is unknown."""
    others = np.array([np.nan, scale, 0.5, 1.0]), np.array([np.inf, half_width, 10.0, 0.0])
    found = refusal(lambda: _refuse_small(JointScales(*others), gains_fitted=fitted))
    assert said in found
    assert bool(said) is bool(found)
    nothing = JointScales(np.array([np.nan]), np.array([np.inf]))
    assert refusal(lambda: _refuse_small(nothing, gains_fitted=False)) == ""


@pytest.mark.parametrize(("correlation", "said"), [(-0.81, True), (-0.79, False)])
def test_a_joint_measures_the_opposite_if_its_correlation_is_below_minus_0_8(correlation, said):
    torque = correlation * SWING[:4000] + np.sqrt(1.0 - correlation**2) * TURNED[:4000]
    signal = SimpleNamespace(valid=np.ones(4000, dtype=bool), torque_nm=torque)
    given = signal, SWING[:4000, :, None], np.array([2.0]), 0
    assert ("joint 1 measures the opposite" in refusal(_refuse_opposite, *given)) is said


@pytest.mark.parametrize(
    ("log_gain", "contradicted", "said"), [(1.09, True, False), (-1.11, True, True), (1.11, False, False)]
)
def test_no_nominal_gain_is_wrong_by_a_factor_of_three(log_gain, contradicted, said):
    fitted = SimpleNamespace(contradicted=np.array([False, contradicted]), log_gain=np.array([2.0, log_gain]))
    found = refusal(_refuse_impossible_gain, SimpleNamespace(gains=fitted, slight=False))
    assert ("the torque of joint 2 contradicts" in found) is said
    _refuse_impossible_gain(SimpleNamespace(gains=fitted, slight=True))
    _refuse_impossible_gain(SimpleNamespace(gains=None))


@pytest.mark.parametrize(
    ("implied", "doubt", "friction_nm", "judged"),
    [(2.1, 0.1, 1.0, True), (1.9, 0.1, 1.0, False), (2.1, 0.01, 20.0, True), (1.9, 0.01, 20.0, False)],
)
def test_what_others_imply_counts_from_20_deviations_and_a_tenth_of_the_friction(implied, doubt, friction_nm, judged):
    assert _is_evidence(np.ones((9, 1)), np.array([implied]), np.array([[doubt**2]]), friction_nm) is judged


@pytest.mark.parametrize(
    ("left", "noise_nm", "compared"), [(0.33, 1.0, "again"), (0.30, 1.0, None), (0.33, 13.0, None)]
)
def test_joints_are_compared_if_a_loud_one_is_unexplained_by_a_tenth_of_its_power(left, noise_nm, compared):
    """Loud is five times the noise of a mean of 100 samples, 6.5 N m with 13 N m; a slight payload says nothing."""
    asked = []
    plain = SimpleNamespace(theta=np.array([1.0]))
    plain.without = lambda joint, afresh: asked.append("again" if afresh else "once") or (np.ones(2), 0, 1)
    torque = np.full((100, 1), 6.0)
    signal = SimpleNamespace(
        valid=np.ones(100, dtype=bool),
        torque_nm=torque,
        averaged_noise_nm=np.array([noise_nm]),
        loaded=SimpleNamespace(
            moves=np.array([True]),
            reversal_weight=np.ones((100, 1)),
            states=SimpleNamespace(velocity_rad_s=np.ones((100, 1))),
        ),
    )
    fit = SimpleNamespace(plain=plain, signal=signal, regressor=(1.0 - left) * torque[:, :, None], determined=True)
    fit.gains, fit.slight = object(), True
    _refuse_contradicting_joint(fit)
    assert not asked
    fit.slight = False
    _refuse_contradicting_joint(fit)
    assert asked == ([compared] if compared else [])
    asked.clear()
    fit.gains = None
    _refuse_contradicting_joint(fit)
    assert asked == ([compared or "once"] if noise_nm == 1.0 else [])


@pytest.mark.parametrize(
    ("mass_kg", "said"), [(0.1, ""), (-0.1, "do not differ by a payload"), (-0.3, "are exchanged: exchange them")]
)
def test_a_mass_below_zero_is_none(mass_kg, said):
    fit = SimpleNamespace(plain=SimpleNamespace(theta=np.array([mass_kg]), half_width_kg=0.2))
    found = refusal(_refuse_no_mass, fit)
    assert said in found
    assert bool(said) is bool(found)


# Notes -----------------------------------------------------------------------------------------------------------


def explained(left_nm, others_nm=0.1, noise_nm=0.1):
    """What is left of 10 N m on joint 2, and on the other two; each joint has moved all the time."""
    torque, left = np.full((4, 3), 10.0), np.full((4, 3), others_nm)
    left[:, 1] = left_nm
    moving = np.ones((4, 3))
    signal = SimpleNamespace(
        loaded=SimpleNamespace(reversal_weight=moving),
        valid=np.ones(4, dtype=bool),
        torque_nm=torque,
        averaged_noise_nm=np.full(3, noise_nm),
    )
    return [*misfit_notes(SimpleNamespace(signal=signal, plain=SimpleNamespace(noise_nm=np.ones(3)), residual_nm=left))]


def test_half_of_the_torque_of_a_loud_joint_or_of_all_is_a_misfit():
    assert explained(4.9) == []
    assert "torque difference of joint 2" in explained(5.1)[0]
    assert "torque difference of joint 2" in explained(5.1, noise_nm=1.99)[0]
    assert explained(5.1, noise_nm=2.01) == [], "loud is five times the noise"
    # 9.9 of 10 N m on one joint and 5 on the others: half of all squares is 150 of 300.
    assert "explains only 51 %" not in explained(9.9, 4.9)[0]
    assert "explains only 49 %" in explained(9.9, 5.2)[0]


def contradicted_gains(noticeable):
    nothing = np.zeros(2, dtype=bool)
    return SimpleNamespace(
        contradicted=nothing,
        possible=nothing,
        disagree=False,
        log_gain=np.zeros(2),
        half_width_95=np.ones(2),
        assumed_deviation=np.ones(2),
        noticeable=np.array([0.0, noticeable]),
    )


@pytest.mark.parametrize(
    ("noticeable", "said"),
    [
        (0.079, ""),
        (0.081, "may go unnoticed in these runs on joint 2 (up to 8 %)"),
        (np.log(1.49), "joint 2 (up to 49 %)"),
        (np.log(1.51), "say nothing about the drive gain of joint 2: even an error of 50 %"),
    ],
)
def test_a_gain_is_not_judged_from_8_percent_on_and_not_at_all_from_50(noticeable, said):
    found = " ".join(_on_contradictions(contradicted_gains(noticeable)))
    assert said in found
    assert bool(said) is bool(found)


def timed(rate=1.0, delay_s=0.0):
    signal = SimpleNamespace(loaded=SimpleNamespace(time_s=np.arange(400), interval_s=0.01, rate=rate))
    posterior = SimpleNamespace(delay_s=delay_s)
    return " ".join(_on_times(SimpleNamespace(signal=signal, plain=SimpleNamespace(posterior=posterior))))


@pytest.mark.parametrize(
    ("rate", "delay_s", "said"),
    [
        (1.0019, 0.0, ""),
        (1.0021, 0.0, "A period took 4 s by the time stamps, 3.992 s by the excitation"),
        (0.951, 0.0, "4.206 s by the excitation"),
        (0.949, 0.0, ""),
        (1.0, 0.0199, ""),
        (1.0, 0.0201, "belongs to positions 20 ms before it"),
        (1.0, -0.0301, "belongs to positions 30 ms after it"),
    ],
)
def test_a_clock_is_wrong_between_0_2_and_5_percent_and_torque_is_late_beyond_20_ms(rate, delay_s, said):
    assert said in timed(rate, delay_s)
    assert bool(said) is bool(timed(rate, delay_s))


@pytest.mark.parametrize(("periods", "said"), [((1, 3), True), ((2, 3), False), ((0, 1), True), ((0, 0), False)])
def test_of_one_period_the_repeatability_is_unknown(periods, said):
    signal = SimpleNamespace(
        smoothing_loss=np.zeros(2),
        valid=np.ones(4, dtype=bool),
        loaded=SimpleNamespace(periodic=any(periods), periods=periods[0]),
        unloaded=SimpleNamespace(periods=periods[1]),
        noise_source=ABOVE_BAND,
    )
    assert any(_on_signal(signal, np.zeros(4, dtype=bool))) is said


@pytest.mark.parametrize(
    ("residual_nm", "coulomb_nm", "moves", "noise_nm", "said"),
    [
        (2.9, 1.0, True, 0.1, False),
        (3.1, 1.0, True, 0.1, True),
        (1.0, -0.19, True, 0.1, False),
        (1.0, -0.21, True, 0.1, True),
        (3.1, 1.0, False, 0.1, False),
        (3.1, 1.0, True, 2.01, False),
    ],
)
def test_links_and_friction_leave_three_tenths_of_a_torque_and_drive_no_joint_by_a_fiftieth(
    residual_nm, coulomb_nm, moves, noise_nm, said
):
    states = SimpleNamespace(velocity_rad_s=np.full((4, 2), 2.0))
    signal = SimpleNamespace(
        unloaded=SimpleNamespace(moves=np.array([True, moves]), states=states),
        averaged_noise_nm=np.array([0.1, noise_nm]),
    )
    body = SimpleNamespace(
        torque_rms_nm=np.full(2, 10.0),
        residual_rms_nm=np.array([1.0, residual_nm]),
        model=SimpleNamespace(coulomb_nm=np.array([1.0, coulomb_nm - 0.02]), viscous_nm_s_rad=np.array([0.0, 0.01])),
    )
    found = list(_on_arm(signal, body))
    assert bool(found) is said
    assert not said or "torque of joint 2 is not that" in found[0]


@pytest.mark.parametrize(("noise", "said"), [(14.9, False), (15.1, True)])
def test_a_joint_that_fits_fifteen_times_worse_than_in_the_calibration_is_named(noise, said):
    plain = SimpleNamespace(
        runs=1,
        noise_nm=np.array([1.0, noise]),
        friction=lambda _: np.zeros((3, 2)),
        friction_covariance=lambda _: np.tile(np.eye(2), (2, 1, 1)),
    )
    found = list(_on_calibrated_arm(plain, SimpleNamespace(drift=np.ones((3, 2)), noise_nm=np.ones(2))))
    assert bool(found) is said
    assert not said or "torque of joint 2 fits more than 15 times worse" in found[0]


@pytest.mark.parametrize(
    ("change_kg", "said"),
    [(-1.59, "by -1.590 +- 0.020 kg; its centre"), (-1.61, "by -1.610 +- 0.020 kg"), (7.9, "; its centre"), (8.1, "")],
)
def test_a_centre_is_stated_for_a_fifth_of_the_greater_mass(change_kg, said):
    found = _by_how_much(
        np.array([2.0, 0.2, *np.zeros(8)]),
        SimpleNamespace(change=np.array([change_kg, 0.0, 0.0, 0.0]), deviation=np.full(4, 0.0102)),
    )
    assert said in found
    assert ("centre" in found) is ("centre" in said)


# Mistakes in columns ---------------------------------------------------------------------------------------------


def correction(cost=0.0, share=0.0, friction=0.1):
    return _Correction(cost, np.array([0.0, share]), np.array([0.1, friction]))


@pytest.mark.parametrize(
    ("share", "friction", "possible"),
    [
        (0.29, 0.1, True),
        (0.31, 0.1, False),
        (0.0, -0.049, True),
        (0.0, -0.051, False),
        (0.2, -0.19, True),
        (0.2, -0.21, False),
    ],
)
def test_a_run_leaves_three_tenths_and_friction_moves_it_by_a_twentieth(share, friction, possible):
    assert correction(0.0, share, friction).possible is possible
    assert not correction(0.0, 0.0, -0.3).driven(np.array([0.0, 0.31]))
    assert correction(0.0, 0.0, -0.3).driven(np.array([0.0, 0.29]))


@pytest.fixture
def turned(monkeypatch):
    """Motors of the wrong sign, where trials with some signs have given results; others are as bad as can be."""

    def turned(trials, n=3, moves=None):
        asked = []

        class Fake:
            def __init__(self, *_):
                pass

            def trial(self, signs):
                joints = tuple(np.flatnonzero(np.diag(signs) < 0.0).tolist())
                asked.append(joints)
                return trials.get(joints, correction(99.0, 0.9))

            def friction_half_width(self, _):
                return np.array([0.0, 0.2])

        monkeypatch.setattr(f"{CHECKS}.column_mistakes._LinksAndFriction", Fake)
        monkeypatch.setattr(f"{CHECKS}.column_mistakes.base_columns", lambda *_: None)
        run = SimpleNamespace(moves=np.ones(n, dtype=bool) if moves is None else np.array(moves))
        return flipped_signs(run, SimpleNamespace(n=n), None), asked

    return turned


@pytest.mark.parametrize(
    ("as_it_is", "other", "found"),
    [
        (correction(2.6, 0.5), correction(1.0), (1,)),
        (correction(2.4, 0.5), correction(1.0), ()),
        (correction(2.6, 0.5), correction(1.0, 0.31), ()),
        (correction(0.6, 0.0, -0.21), correction(1.0), (1,)),
        (correction(0.4, 0.0, -0.21), correction(1.0), ()),
        (correction(0.6, 0.0, -0.19), correction(1.0), ()),
    ],
)
def test_a_sign_is_wrong_if_the_residual_is_smaller_by_far_or_friction_drives_the_arm(turned, as_it_is, other, found):
    """By 1.5 of its logarithm; else it may be greater by half where friction drives beyond its half width."""
    assert turned({(): as_it_is, (1,): other})[0] == found


def test_of_up_to_eight_joints_all_signs_are_tried_and_of_more_two_at_once(turned):
    better = {(): correction(9.0), (0,): correction(3.0), (0, 2): correction(2.0), (0, 1, 2): correction(1.0)}
    assert turned(better)[0] == (0, 1, 2)
    assert len(turned({(): correction()}, 8)[1]) == 2**8
    assert len(turned({(): correction()}, 9)[1]) == 1 + 9 + 36
    assert turned(better, 9)[0] == (0, 2)
    assert turned(better, 3, [True, False, True])[1] == [(), (0,), (2,), (0, 2)]


@pytest.mark.parametrize(("cost", "found"), [(0.9, True), (1.1, False)])
def test_columns_are_exchanged_if_the_residual_is_smaller_by_1_5_of_its_logarithm(monkeypatch, cost, found):
    """The torques of three joints in a cycle: joint 1 has those of joint 3."""
    cycle = np.eye(3)[[2, 0, 1]]

    @dataclass
    class Moving:
        states: JointStates
        moves = np.ones(3, dtype=bool)

    class Fake:
        def __init__(self, run, chain, coupling, base):
            self.as_it_is = run is given and hasattr(chain, "under")

        def trial(self, columns):
            if self.as_it_is and np.array_equal(columns, np.eye(3)):
                return correction(2.5)
            return correction(cost if self.as_it_is and np.array_equal(columns, cycle) else 99.0)

    monkeypatch.setattr(f"{CHECKS}.column_mistakes._LinksAndFriction", Fake)
    monkeypatch.setattr(f"{CHECKS}.column_mistakes.base_columns", lambda *_: None)
    chain = SimpleNamespace(n=3, gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    chain.under = lambda _: SimpleNamespace(n=3)
    given = Moving(JointStates(*np.ones((3, 1, 3))))
    exchange = exchanged_columns(given, chain, None)
    assert (exchange is not None) is found
    assert not found or exchange.joints == (0, 1, 2)


def pair_of(slope=1.0, residual=0.1, coulomb=1.0, moves=True, noise=0.1):
    """A pair whose second joint has a loaded torque that is a multiple of its unloaded one, of 10 N m."""
    unloaded = 10.0 * np.sqrt(2.0) * np.hstack([SWING, SWING])
    runs = [
        SimpleNamespace(
            torque_nm=unloaded * factor,
            moves=np.array([True, moves]),
            states=SimpleNamespace(velocity_rad_s=np.ones((4001, 2))),
        )
        for factor in ([1.0, slope], [1.0, 1.0])
    ]
    signal = SimpleNamespace(
        loaded=runs[0], unloaded=runs[1], valid=np.ones(4001, dtype=bool), averaged_noise_nm=np.array([0.1, noise])
    )
    recorded_as = [SimpleNamespace(recording=SimpleNamespace(source=SimpleNamespace(path=path))) for path in "ab"]
    columns = RunColumns(signal, recorded_as, None, None, None)
    model = SimpleNamespace(coulomb_nm=np.array([1.0, coulomb - 0.1]), viscous_nm_s_rad=np.full(2, 0.1))
    columns.__dict__["arm"] = SimpleNamespace(
        model=model, torque_rms_nm=np.full(2, 10.0), residual_rms_nm=np.array([0.1, 10.0 * residual])
    )
    return columns


@pytest.mark.parametrize(
    ("changes", "right"),
    [
        ({}, True),
        ({"slope": 0.21}, True),
        ({"slope": 0.19}, False),
        ({"slope": 0.19, "moves": False}, True),
        ({"residual": 0.29}, True),
        ({"residual": 0.31}, False),
        ({"residual": 0.31, "moves": False}, True),
        ({"residual": 0.31, "noise": 10.1}, True),
        ({"coulomb": -0.49}, True),
        ({"coulomb": -0.51}, False),
    ],
)
def test_columns_look_right_if_links_and_friction_explain_the_arm_and_both_runs_are_alike(changes, right):
    """A fifth of the unloaded torque is in the loaded one; three tenths of it are left, and a twentieth drives it."""
    assert pair_of(**changes).look_right is right


@pytest.mark.parametrize(
    ("first", "second", "slope", "said"),
    [
        ((1,), (1,), 1.0, "a and b: joint 2 measures the opposite"),
        ((1,), (), -1.0, "a: joint 2 measures the opposite"),
        ((), (1,), -1.0, "b: joint 2 measures the opposite"),
        ((), (1,), 1.0, None),
        ((0, 1), (0, 1), 1.0, "a and b: joints 1 and 2 measure the opposite .* The sign of their current"),
    ],
)
def test_a_sign_of_one_run_must_show_in_the_comparison_of_both(monkeypatch, first, second, slope, said):
    columns = pair_of(slope=slope)
    signs = {id(columns.signal.loaded): first, id(columns.signal.unloaded): second}
    monkeypatch.setattr(f"{CHECKS}.column_mistakes.flipped_signs", lambda run, *_: signs[id(run)])
    monkeypatch.setattr(f"{CHECKS}.column_mistakes.exchanged_columns", lambda *_: None)
    assert re.match(said, refusal(columns.require_right)) if said else refusal(columns.require_right) == ""


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        (("the currents or torques", (0, 1)), None, "a: the currents or torques of joints 1 and 2 are exchanged"),
        (None, ("the currents or torques", (0, 1)), "b: the currents or torques of joints 1 and 2 are exchanged"),
        (("the currents or torques", (0, 1)), ("the currents or torques", (0, 1)), "a and b: the currents or torques"),
        (("the positions", (0, 1)), None, "a and b: the positions of joints 1 and 2 are exchanged: links and friction"),
        (None, None, None),
    ],
)
def test_exchanged_positions_are_those_of_both_runs(monkeypatch, first, second, said):
    columns = pair_of()
    found = {id(columns.signal.loaded): first, id(columns.signal.unloaded): second}
    exchange = {key: value and _Exchange(value[1], value[0]) for key, value in found.items()}
    monkeypatch.setattr(f"{CHECKS}.column_mistakes.flipped_signs", lambda *_: ())
    monkeypatch.setattr(f"{CHECKS}.column_mistakes.exchanged_columns", lambda run, *_: exchange[id(run)])
    assert refusal(columns.require_right).startswith(said) if said else refusal(columns.require_right) == ""
