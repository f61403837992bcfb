"""The difference of two runs by their phases, and a run minus a prediction."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.signals.load_signal import LoadSignal, load_signal, without_body
from armload_identification.signals.motion import ABOVE_BAND, SCATTER
from armload_identification.signals.recorded_run import Run
from tests.four_samples import motion

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    """A loaded and an unloaded run, each with a part of its phases."""
    trajectory = pinocchio_arm.trajectory(period_s=5.0)
    whole = [pinocchio_arm.run(trajectory, load, seed=3 + load, periods=1) for load in (True, False)]

    def runs(first=slice(None), second=slice(None), truncated=(False, False)):
        made = []
        for run, rows, cut in zip(whole, (first, second), truncated, strict=True):
            part = run.rows(rows)
            made.append(Run.of(replace(part, source=replace(part.source, truncated=cut)), pinocchio_arm.transmission))
        return made

    return runs


@pytest.mark.parametrize(
    ("first", "second"),
    [(slice(0, 400), slice(0, 400)), (slice(100, 400), slice(0, 450)), (slice(0, 400), slice(50, 450))],
)
def test_runs_of_less_than_a_period_are_laid_over_each_other_by_their_phases(runs, first, second):
    """Both were stamped at the same phases, so each sample of one belongs to the sample of the other at its time."""
    signal = load_signal(*runs(first, second))
    assert not signal.loaded.periodic
    assert (signal.loaded.periods, signal.unloaded.periods) == (1, 1)
    assert signal.shift_s == pytest.approx(0.0, abs=1e-6)
    assert (signal.mismatch_rad < 1e-3).all()


def test_where_a_run_has_a_gap_its_path_is_not_compared(runs):
    """Through 1.2 s without rows the spline is a tenth of a radian off."""
    whole = load_signal(*runs())
    gap = load_signal(*runs(np.r_[0:150, 270:500]))
    assert (gap.mismatch_rad < 2.0 * whole.mismatch_rad + 1e-3).all()
    apart = np.abs(gap.loaded.states.position_rad - gap.unloaded.states.position_rad)
    assert apart[~gap.valid].max() > 0.05


@pytest.mark.parametrize(
    ("first", "second", "truncated", "text"),
    [
        (slice(0, 200), slice(150, 400), (False, False), "share 0.49 s of their excitation, because loaded.mcap ends"),
        (slice(150, 400), slice(0, 200), (False, True), "because unloaded.mcap ends there: the file is truncated. Rec"),
        (
            slice(0, 100),
            slice(300, 400),
            (False, False),
            "share 0 s of their excitation, because loaded.mcap ends there.",
        ),
    ],
)
def test_runs_that_share_too_little_of_their_excitation_are_refused(runs, first, second, truncated, text):
    with pytest.raises(RecordingError) as caught:
        load_signal(*runs(first, second, truncated))
    assert text in str(caught.value)


def test_a_second_in_common_is_enough(runs):
    signal = load_signal(*runs(slice(0, 250), slice(145, 400)))
    assert 0.5 < signal.loaded.time_s[-1] < 1.1


def test_a_prediction_has_no_noise_and_no_periods(runs):
    motion = runs()[0].motion
    body_nm = 0.25 * motion.torque_nm
    signal = without_body(motion, body_nm)
    np.testing.assert_allclose(signal.torque_nm, 0.75 * motion.torque_nm)
    np.testing.assert_allclose(signal.raw_nm, motion.raw_nm - body_nm)
    np.testing.assert_allclose(signal.noise_nm, motion.noise_nm)
    np.testing.assert_allclose(signal.averaged_noise_nm, motion.averaged_noise_nm)
    np.testing.assert_allclose(signal.smoothing_loss, motion.smoothing_loss)
    assert (signal.loaded.periods, signal.unloaded.periods) == (1, 0)
    assert signal.shift_s == 0.0
    assert not signal.mismatch_rad.any()


# Two runs of which everything is known ---------------------------------------------------------------------------


def test_a_signal_is_the_difference_of_two_runs_with_the_noise_of_both():
    odd = np.array([True, True, False, True])
    signal = LoadSignal(motion(7.0, 3.0, valid=odd), motion(2.0, 4.0, valid=odd[::-1]), np.zeros(1), 0.0)
    assert (signal.raw_nm[0, 0], signal.torque_nm[0, 0]) == (5.0, 2.5)
    assert (signal.noise_nm[0], signal.averaged_noise_nm[0], signal.smoothing_loss[0]) == (5.0, 2.5, 0.4)
    assert signal.valid.tolist() == [True, False, False, True]
    assert (signal.noise_source, signal.loaded.periods, signal.unloaded.periods) == (SCATTER, 2, 2)
    assert (signal.empty_arm.averaged_noise_nm[0], signal.empty_arm.raw_nm[0, 0]) == (2.5, 2.0)
    one = LoadSignal(motion(), motion(noise_source=ABOVE_BAND), np.zeros(1), 0.0)
    assert one.noise_source == ABOVE_BAND
    # Residual 4 in the valid samples, and the noise that averaging removed: 25 - 6.25.
    predicted = np.array([[1.0], [99.0], [99.0], [1.0]])
    assert signal.raw_residual_rms(predicted) == pytest.approx(np.sqrt(16.0 + 25.0 - 6.25))


@pytest.mark.parametrize(("speed", "sag_nm"), [(1.0, 1.1 * 0.5 + 0.6), (-1.0, 0.9 * 0.5 + 0.6)])
def test_the_torque_of_links_and_rotors_between_two_paths_is_added_to_the_unloaded_run(speed, sag_nm):
    """(1 + 0.1 s) (10 - 9.5) N m of links, and 3 kg m2 times 0.2 rad/s2."""
    states = [JointStates(*(np.full((4, 1), v) for v in (q, speed, a))) for q, a in ((10.0, 0.5), (9.5, 0.3))]
    body = SimpleNamespace(
        link_torque=lambda _, position, *__: position,
        load_friction=np.array([0.1]),
        reversal_speed_rad_s=np.array([1e-9]),
        rotor_mass_kg_m2=np.array([[3.0]]),
    )
    pair = LoadSignal(motion(7.0, states=states[0]), motion(2.0, states=states[1]), np.zeros(1), 0.0)
    found = pair.on_one_motion(None, body)
    np.testing.assert_allclose(found.unloaded.raw_nm, 2.0 + sag_nm)
    np.testing.assert_allclose(found.unloaded.torque_nm, 1.0 + sag_nm)
    assert found.unloaded.states is pair.loaded.states


def test_torque_that_is_late_belongs_to_an_earlier_motion_and_gains_turn_it():
    ramp = JointStates(*(np.full((4, 1), v) for v in (1.0, 2.0, 4.0)))
    pair = LoadSignal(motion(7.0, states=ramp), motion(2.0, states=ramp), np.zeros(1), 0.0)
    late = pair.of_both(lambda run: run.with_delay(0.1))
    for run in (late.loaded, late.unloaded):
        np.testing.assert_allclose(run.states.position_rad, 1.0 - 0.1 * 2.0 + 0.5 * 0.01 * 4.0)
        np.testing.assert_allclose(run.states.velocity_rad_s, 2.0 - 0.1 * 4.0)
    np.testing.assert_allclose(pair.of_both(lambda run: run.with_torque_times(np.array([[3.0]]))).raw_nm, 15.0)
