"""Signals: filters against SciPy and the paper's own rows; folding, alignment and the torque difference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from armload_identification.identification_errors import ModelError, RecordingError
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.phase_advance import periodic_phase, phases_of, whole_periods
from armload_identification.signals import periods as folding
from armload_identification.signals.filters import low_pass, low_pass_cutoff, smooth, smoothing_loss, white_noise
from armload_identification.signals.joint_torque import Transmission, gain_shares, joint_torque
from armload_identification.signals.load_signal import load_signal, time_shift
from armload_identification.signals.motion import ABOVE_BAND, SCATTER
from armload_identification.signals.periods import fold
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.signal_constants import LowPass
from armload_identification.signals.spline import fit_motion

pytestmark = pytest.mark.pure


def chen_once(y):
    """Chen 2016, eq. (8), written out: the middle rows and the four special rows at the ends."""
    out = np.empty_like(y)
    out[0] = (69 * y[0] + 4 * (y[1] + y[3]) - 6 * y[2] - y[4]) / 70
    out[1] = (2 * (y[0] + y[4]) + 27 * y[1] + 12 * y[2] - 8 * y[3]) / 35
    for k in range(2, len(y) - 2):
        out[k] = (-3 * (y[k - 2] + y[k + 2]) + 12 * (y[k - 1] + y[k + 1]) + 17 * y[k]) / 35
    out[-2] = (2 * (y[-5] + y[-1]) - 8 * y[-4] + 12 * y[-3] + 27 * y[-2]) / 35
    out[-1] = (-y[-5] + 4 * (y[-4] + y[-2]) - 6 * y[-3] + 69 * y[-1]) / 70
    return out


def test_coupled_motors_and_joints_see_the_same_power():
    rng = np.random.default_rng(1)
    coupling = np.eye(3) + 0.1 * rng.normal(size=(3, 3))
    transmission = Transmission(np.array([90.0, 50.0, 20.0]), coupling)
    current = rng.normal(size=(7, 3))
    axis_speed = rng.normal(size=(7, 3))
    motor_power = np.sum(current * transmission.gain_nm_a * axis_speed, axis=1)
    joint_power = np.sum(transmission.joint_torque(current) * (axis_speed @ coupling.T), axis=1)
    np.testing.assert_allclose(joint_power, motor_power, rtol=1e-12)


def test_the_shares_of_the_gains_add_up_to_the_torque_and_are_its_slope():
    rng = np.random.default_rng(12)
    gain, coupling = np.array([90.0, 50.0, 20.0]), np.eye(3) + 0.2 * rng.normal(size=(3, 3))
    current = rng.normal(size=(7, 3))
    torque = Transmission(gain, coupling).joint_torque(current)
    shares = gain_shares(torque, coupling)
    np.testing.assert_allclose(shares.sum(axis=0), torque, rtol=1e-10)
    for axis in range(3):
        more = Transmission(gain * (1.0 + 1e-3 * (np.arange(3) == axis)), coupling).joint_torque(current)
        np.testing.assert_allclose((more - torque) / 1e-3, shares[axis], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("gain", "coupling"),
    [([1.0, 0.0], np.eye(2)), ([1.0, -2.0], np.eye(2)), ([1.0, 2.0], np.eye(3)), ([1.0, 2.0], np.ones((2, 2)))],
)
def test_a_transmission_that_makes_no_sense_is_refused(gain, coupling):
    with pytest.raises(ModelError):
        Transmission(np.array(gain), coupling)


def test_smoothing_is_the_papers_and_keeps_cubics():
    rng = np.random.default_rng(2)
    raw = rng.normal(size=(40, 2))
    expected = raw
    for _ in range(5):
        expected = chen_once(expected)
    np.testing.assert_allclose(smooth(raw), expected, atol=1e-12)
    t = np.linspace(-1.0, 1.0, 30)[:, None]
    np.testing.assert_allclose(smooth(1.0 - 2.0 * t + t**3), 1.0 - 2.0 * t + t**3, atol=1e-12)


def test_smoothing_loss_is_a_share_of_the_rms():
    raw = np.column_stack([np.ones(10), np.zeros(10)])
    np.testing.assert_allclose(smoothing_loss(raw, 0.9 * raw), [0.1, 0.0], atol=1e-12)


def test_low_pass_has_no_delay():
    t = 0.01 * np.arange(2000)
    slow, fast = np.sin(2 * np.pi * 0.5 * t), np.sin(2 * np.pi * 20.0 * t)
    out = low_pass((slow + fast)[:, None], 0.01, 4.0)[:, 0]
    np.testing.assert_allclose(out[200:-200], slow[200:-200], atol=2e-3)


@pytest.mark.parametrize("rows", [37, 150, 1999, 4000])
def test_low_pass_is_scipys_butterworth_of_order_four_twice(rows):
    interval_s, cutoff_hz = 0.01, 4.0
    values = np.array([0.0, 50.0, -1e3]) + np.cumsum(np.random.default_rng(5).normal(size=(rows, 3)), axis=0)
    sections = butter(4, cutoff_hz, fs=1.0 / interval_s, output="sos")
    expected = sosfiltfilt(sections, values, axis=0, padlen=min(rows - 1, 75))
    found = low_pass(values, interval_s, cutoff_hz)
    spread = np.ptp(values, axis=0)
    assert (np.abs(found - expected).max(axis=0) < 1e-2 * spread).all()
    inner = slice(200, -200)
    assert (np.abs(found - expected)[inner] < 1e-7 * spread).all()


def test_white_noise_is_measured_also_where_it_is_rarely_seen():
    rng = np.random.default_rng(13)
    normal = 0.7 * rng.normal(size=(100_000, 1))
    np.testing.assert_allclose(white_noise(normal), 0.7, rtol=0.01)
    # A coarse converter reports the same number most of the time.
    rare = (rng.uniform(size=(100_000, 1)) < 0.02) * 1.0
    np.testing.assert_allclose(white_noise(rare), np.sqrt(0.02 * 0.98), rtol=0.05)


def test_one_motor_without_information_does_not_refuse_a_run_and_reported_torque_counts(pair, pinocchio_arm):
    run = pair[0]
    still = replace(run, current_a=run.current_a * (np.arange(6) != 5))
    assert np.ptp(joint_torque(still, pinocchio_arm.transmission), axis=0)[0] > 0.0
    reported = np.cos(np.arange(run.time_s.size))[:, None] * np.arange(1.0, 7.0)
    both = replace(run, torque_nm=reported)
    np.testing.assert_array_equal(joint_torque(both, pinocchio_arm.transmission), reported)


def test_white_noise_is_distinguished_from_a_signal_with_jumps():
    rng = np.random.default_rng(3)
    t = 0.01 * np.arange(4000)
    signal = 50.0 * np.sin(2 * np.pi * 0.4 * t) + 8.0 * np.sign(np.sin(2 * np.pi * 0.3 * t))
    measured = signal[:, None] + rng.normal(size=(4000, 1)) * 0.5
    np.testing.assert_allclose(white_noise(measured), 0.5, rtol=0.05)


def test_a_signal_that_stands_still_is_refused(pair, pinocchio_arm):
    dead = replace(pair[0], current_a=np.zeros_like(pair[0].current_a))
    with pytest.raises(RecordingError, match="every column of current_a is constant"):
        joint_torque(dead, pinocchio_arm.transmission)


def test_folding_measures_the_period_and_the_scatter(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    run = pinocchio_arm.run(trajectory, True, seed=4, periods=6, rate=1.1)
    torque = joint_torque(run, pinocchio_arm.transmission)
    folded = fold(run, torque, phases_of(*periodic_phase(run)))
    assert folded.periods == whole_periods(run) == 6
    assert folded.interval_s * len(folded.time_s) == pytest.approx(5.5, rel=1e-9)
    np.testing.assert_allclose(folded.noise_nm, pinocchio_arm.noise_nm, rtol=0.06)
    phase = np.arange(500) / 500
    truth = trajectory.evaluate(phase * 5.0)
    fitted = folded.states
    np.testing.assert_allclose(fitted.position_rad, truth.position_rad, atol=1e-5)
    np.testing.assert_allclose(fitted.velocity_rad_s, truth.velocity_rad_s / 1.1, atol=1e-4)
    np.testing.assert_allclose(fitted.acceleration_rad_s2, truth.acceleration_rad_s2 / 1.1**2, atol=1e-3)
    exact = pinocchio_arm.torque(
        truth.position_rad, truth.velocity_rad_s / 1.1, truth.acceleration_rad_s2 / 1.21, pinocchio_arm.payload
    )
    error = (folded.raw_nm - exact) / (pinocchio_arm.noise_nm / np.sqrt(6))
    assert 0.9 < np.sqrt(np.mean(error**2)) < 1.1


@pytest.mark.parametrize("slow", [0.0, 0.9])
def test_folding_measures_how_long_the_noise_lasts(pinocchio_arm, slow):
    """Noise of which each sample remembers that share of the one before, beside white noise."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(1), True, seed=1, periods=6)
    torque = joint_torque(run, pinocchio_arm.transmission)
    fresh = np.random.default_rng(3).normal(size=torque.shape) * 5.0 * pinocchio_arm.noise_nm
    noise = lfilter([np.sqrt(1.0 - slow**2)], [1.0, -slow], fresh, axis=0)
    memory = fold(run, torque + noise, phases_of(*periodic_phase(run))).noise_memory
    assert memory[0] == 1.0
    np.testing.assert_allclose(memory[1:15], slow ** np.arange(1, 15) / (1.0 + 1.0 / 25.0), atol=0.06)
    assert abs(memory[-1]) < 1e-3


def test_noise_of_one_period_counts_as_white(pinocchio_arm):
    run = pinocchio_arm.run(pinocchio_arm.trajectory(1), True, seed=1, periods=1)
    torque = joint_torque(run, pinocchio_arm.transmission)
    np.testing.assert_array_equal(fold(run, torque, phases_of(*periodic_phase(run))).noise_memory, [1.0])


def test_a_motion_of_4_hz_is_seen_at_20_samples_per_second(pinocchio_arm, monkeypatch):
    """The arm does not follow the excitation exactly; its series is not cut off where few samples per second do it."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), True, seed=4, cycle_s=0.05)
    shaken = run.position_rad + 1e-3 * np.sin(8.0 * np.pi * run.phase_s)[:, None]
    fitted, fit = [], folding._fit_motion
    monkeypatch.setattr(folding, "_fit_motion", lambda *given: fitted.append(fit(*given)) or fitted[-1])
    folded = fold(replace(run, position_rad=shaken), joint_torque(run, pinocchio_arm.transmission), 100)
    assert (folded.position_fit_rad < 5e-5).all()
    assert fitted[0][0].harmonics <= 0.5 * 0.45 * 100


def test_missing_cycles_are_averaged_around(pinocchio_arm):
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), True, seed=5, noise=0.0)
    torque = joint_torque(run, pinocchio_arm.transmission)
    whole = fold(run, torque, 500)
    kept = np.ones(1500, dtype=bool)
    kept[[3, 700, 701, 1400]] = False
    kept[[42, 542, 1042]] = False
    holed = replace(
        run,
        time_s=run.time_s[kept],
        position_rad=run.position_rad[kept],
        current_a=run.current_a[kept],
        phase_s=run.phase_s[kept],
    )
    folded = fold(holed, torque[kept], 500)
    assert np.flatnonzero(~folded.valid).tolist() == [43]
    np.testing.assert_allclose(folded.raw_nm[folded.valid], whole.raw_nm[folded.valid], atol=1e-9)


def test_phases_off_any_grid_are_interpolated(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    run = pinocchio_arm.run(trajectory, True, seed=6, periods=5, noise=0.0)
    step = 0.01 * 0.7313
    phase = np.arange(1, int(20.0 / step)) * step
    torque = np.column_stack(
        [np.interp(phase, run.phase_s, column) for column in joint_torque(run, pinocchio_arm.transmission).T]
    )
    position = np.asarray(trajectory.evaluate(phase).position_rad)
    odd = replace(run, time_s=phase / 0.7313, position_rad=position, phase_s=phase, current_a=torque)
    folded = fold(odd, torque, phases_of(*periodic_phase(odd)))
    assert folded.periods == 3
    assert folded.interval_s * len(folded.time_s) == pytest.approx(5.0 / 0.7313, rel=1e-9)
    exact = fold(run, joint_torque(run, pinocchio_arm.transmission), folded.raw_nm.shape[0])
    np.testing.assert_allclose(np.sqrt(np.mean((folded.raw_nm - exact.raw_nm) ** 2, axis=0)), np.zeros(6), atol=0.3)


def interrupted(run, *pauses_s):
    """A run with pauses: from each of these phases on, half a second of phase has no row and two more seconds pass."""
    kept = np.ones(run.size, dtype=bool)
    late_s = np.zeros(run.size)
    for pause_s in pauses_s:
        kept &= ~((run.phase_s > pause_s) & (run.phase_s < pause_s + 0.5))
        late_s += 2.0 * (run.phase_s > pause_s)
    return replace(run, time_s=run.time_s + late_s).rows(kept)


def test_a_pause_costs_a_period_and_nothing_else(pair, pinocchio_arm):
    """Between the pauses, samples are those of the same phases, and the time of the pauses does not count."""
    whole = pair[0]
    for pauses_s, periods in (((7.3,), 2), ((4.9,), 2), ((2.0, 8.0), 2), ((2.0, 7.2), 1), ((3.0, 6.0, 12.0), 2)):
        run = interrupted(whole, *pauses_s)
        folded, complete = (fold(r, joint_torque(r, pinocchio_arm.transmission), 500) for r in (run, whole))
        assert (folded.periods, complete.periods) == (periods, 3)
        assert folded.valid.all()
        assert folded.interval_s * len(folded.time_s) == pytest.approx(5.0, rel=1e-9)
        torque = joint_torque(whole, pinocchio_arm.transmission).reshape(3, 500, 6)
        phase = whole.phase_s.reshape(3, 500, 1)
        settled = phase - phase[0, 0] >= 0.3
        for pause_s in pauses_s:
            resumed_s = run.phase_s[run.phase_s > pause_s][0]
            settled &= (phase <= pause_s) | (phase - resumed_s >= 0.3)
        expected = np.roll((torque * settled).sum(axis=0) / settled.sum(axis=0), 1, axis=0)
        np.testing.assert_allclose(folded.raw_nm, expected, atol=1e-9)


def test_a_run_without_a_phase_that_was_measured_in_some_period_is_refused(pair):
    for pauses_s in ((2.0, 7.0, 12.0), (2.0, 6.6, 12.3)):
        run = interrupted(pair[0], *pauses_s)
        with pytest.raises(RecordingError, match="a part of the period was never measured at full speed"):
            fold(run, run.position_rad, 500)


def test_a_change_of_speed_within_the_periods_is_refused(pair):
    run = pair[0]
    slower = replace(run, time_s=run.time_s + 0.2 * np.maximum(run.phase_s - 8.0, 0.0))
    with pytest.raises(RecordingError, match="paused or changed its speed"):
        fold(slower, run.position_rad, 500)


def test_a_spline_through_irregular_samples_gives_the_derivatives(pinocchio_arm):
    rng = np.random.default_rng(7)
    trajectory = pinocchio_arm.trajectory(period_s=10.0)
    t = np.cumsum(rng.choice([0.009, 0.01, 0.012, 0.034], p=[0.1, 0.6, 0.28, 0.02], size=2000))
    state = trajectory.evaluate(t)
    motion = fit_motion(t, np.round(state.position_rad, 4))
    inner = (t > 0.5) & (t < t[-1] - 0.5)
    elapsed = t - t[0]
    speed = motion.spline(elapsed, 1)[inner]
    acceleration = motion.spline(elapsed, 2)[inner]
    assert np.abs(speed - state.velocity_rad_s[inner]).max() < 2e-3
    assert np.sqrt(np.mean((acceleration - state.acceleration_rad_s2[inner]) ** 2)) < 5e-3


@pytest.mark.parametrize("interval_s", [0.04, 0.08])
def test_a_spline_follows_motion_that_few_samples_show(pinocchio_arm, interval_s):
    """With knots at least 8 samples apart it was up to 0.1 rad off, and a payload's mass 20 %."""
    rng = np.random.default_rng(8)
    trajectory = pinocchio_arm.trajectory(period_s=10.0)
    t = interval_s * np.arange(round(60.0 / interval_s))
    position = trajectory.evaluate(t).position_rad
    motion = fit_motion(t, position + 1e-5 * rng.normal(size=position.shape))
    assert np.abs(motion.spline(t) - position).max() < 1e-4


def test_the_grid_of_a_long_run_stays_at_its_samples(pinocchio_arm):
    """Time stamps since 1970 are multiples of 0.24 us: steps of one of them would be a sample late after 70 minutes."""
    time_s = 1_700_000_000.0 + 0.0075 * np.arange(20_000)
    state = pinocchio_arm.trajectory(period_s=10.0).evaluate(time_s - time_s[0])
    run = Recording.from_arrays(time_s, state.position_rad, torque_nm=state.position_rad)
    grid = Run.of(run, pinocchio_arm.transmission).moving_part.moving_grid(0.0, float(time_s[-1] - time_s[0]))
    place = grid.elapsed_s / 0.0075
    assert np.abs(place - np.round(place)).max() < 1e-4


@pytest.mark.parametrize("late_s", [-1.2345, 0.0, 2.7182])
def test_the_time_between_two_runs_is_found_from_positions(pinocchio_arm, late_s):
    trajectory = pinocchio_arm.trajectory(period_s=12.0)
    rng = np.random.default_rng(8)
    first = np.sort(rng.uniform(0.0, 15.0, 1500))
    second = np.sort(rng.uniform(0.0, 16.0, 1600))
    one = fit_motion(first, trajectory.evaluate(first).position_rad)
    two = fit_motion(second, trajectory.evaluate(second - late_s).position_rad)
    shift = time_shift(one, two) + second[0] - first[0]
    assert shift == pytest.approx(late_s, abs=1e-4)


def test_the_difference_of_runs_is_the_payloads_torque(pair, pinocchio_arm):
    signal = load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in pair))
    states = signal.loaded.states
    payload = pinocchio_arm.torque(*states, pinocchio_arm.payload) - pinocchio_arm.torque(*states)
    assert signal.loaded.periodic
    assert (signal.loaded.periods, signal.unloaded.periods) == (3, 3)
    assert signal.noise_source == SCATTER
    np.testing.assert_allclose(signal.noise_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.08)
    np.testing.assert_allclose(signal.averaged_noise_nm, signal.noise_nm / np.sqrt(3.0), rtol=1e-9)
    error = (signal.raw_nm - payload) / signal.averaged_noise_nm
    assert 0.9 < np.sqrt(np.mean(error**2)) < 1.1
    assert np.sqrt(np.mean((signal.torque_nm - payload) ** 2)) < np.sqrt(np.mean((signal.raw_nm - payload) ** 2))
    assert (signal.smoothing_loss < 0.02).all()
    assert (signal.mismatch_rad < 1e-5).all()


def test_a_residual_of_single_samples_holds_the_noise_that_averaging_removed(pair, pinocchio_arm):
    """Of P periods the average keeps 1 / P of the noise's variance; what a prediction misses is added to the rest."""
    signal = load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in pair))
    assert signal.loaded.periods == signal.unloaded.periods > 1
    removed = signal.noise_nm**2 * (1.0 - 1.0 / signal.loaded.periods)
    for missed_nm in (0.0, 0.2):
        found = signal.raw_residual_rms(signal.raw_nm + missed_nm)
        np.testing.assert_allclose(found, np.sqrt(missed_nm**2 + removed))


def test_without_a_period_the_runs_are_laid_over_each_other(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory(period_s=10.0)
    loaded = pinocchio_arm.run(trajectory, True, seed=21, periods=2, with_phase=False)
    unloaded = pinocchio_arm.run(trajectory, False, seed=22, periods=2, with_phase=False)
    rng = np.random.default_rng(9)
    keep = rng.uniform(size=2000) > 0.03
    keep[700:712] = False
    loaded = replace(
        loaded,
        time_s=loaded.time_s[keep] + 700.0,
        position_rad=loaded.position_rad[keep],
        current_a=loaded.current_a[keep],
    )
    signal = load_signal(Run.of(loaded, pinocchio_arm.transmission), Run.of(unloaded, pinocchio_arm.transmission))
    states = signal.loaded.states
    payload = pinocchio_arm.torque(*states, pinocchio_arm.payload) - pinocchio_arm.torque(*states)
    assert not signal.loaded.periodic
    assert signal.noise_source == ABOVE_BAND
    assert signal.shift_s == pytest.approx(-700.0, abs=1e-3)
    assert 0 < np.count_nonzero(~signal.valid) < 30
    np.testing.assert_allclose(signal.noise_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.1)
    error = (signal.raw_nm - payload)[signal.valid] / signal.averaged_noise_nm
    assert 0.9 < np.sqrt(np.mean(error**2)) < 1.15


@pytest.mark.parametrize("with_phase", [True, False])
def test_both_runs_go_through_the_same_filter(pinocchio_arm, with_phase):
    """Filters are linear: with equal filters, the difference of filtered runs is the filtered difference."""
    trajectory = pinocchio_arm.trajectory()
    runs = [pinocchio_arm.run(trajectory, load, seed=61 + load, periods=2, with_phase=with_phase) for load in (1, 0)]
    signal = load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in runs))
    if with_phase:
        filtered = smooth(signal.raw_nm)
    else:
        cutoff_hz = low_pass_cutoff(signal.loaded.states.velocity_rad_s, signal.loaded.interval_s)
        filtered = low_pass(signal.raw_nm, signal.loaded.interval_s, cutoff_hz)
    np.testing.assert_allclose(signal.torque_nm, filtered, atol=1e-9)


def test_stamps_with_jitter_leave_no_gap_where_the_motion_is_as_fast_as_the_samples_allow(pinocchio_arm):
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), True, seed=63, cycle_s=0.1, with_phase=False)
    jitter_s = 0.005 * np.random.default_rng(63).uniform(-1.0, 1.0, run.size)
    motion = Run.of(replace(run, time_s=run.time_s + jitter_s), pinocchio_arm.transmission).motion
    cutoff_hz = low_pass_cutoff(motion.states.velocity_rad_s, motion.interval_s)
    assert cutoff_hz == pytest.approx(LowPass.highest_of_rate / motion.interval_s)
    assert motion.valid.all()


@pytest.mark.parametrize("periods", [(1, 1), (3, 1), (1, 3)])
def test_where_one_run_has_one_period_its_noise_is_that_above_the_band(pinocchio_arm, periods):
    """One period has no scatter: no division by zero degrees of freedom, and no zero noise."""
    trajectory = pinocchio_arm.trajectory()
    runs = [
        pinocchio_arm.run(trajectory, load, seed=71 + load, periods=count)
        for load, count in zip((True, False), periods, strict=True)
    ]
    signal = load_signal(*(Run.of(run, pinocchio_arm.transmission) for run in runs))
    assert (signal.loaded.periods, signal.unloaded.periods) == periods
    assert signal.noise_source == ABOVE_BAND
    np.testing.assert_allclose(signal.noise_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.2)
    kept = np.sqrt((1.0 / periods[0] + 1.0 / periods[1]) / 2.0)
    np.testing.assert_allclose(signal.averaged_noise_nm, kept * signal.noise_nm, rtol=0.1)


def test_runs_that_do_not_belong_together_are_refused(pair, pinocchio_arm):
    loaded, unloaded = pair
    transmission = pinocchio_arm.transmission
    other = pinocchio_arm.run(pinocchio_arm.trajectory(seed=5), False, seed=1)
    with pytest.raises(RecordingError, match="different excitations"):
        load_signal(Run.of(loaded, transmission), Run.of(other, transmission))
    free = [replace(run, phase_s=None, excitation=None) for run in (loaded, other)]
    with pytest.raises(RecordingError, match=r"not of the same trajectory: .*joint \d differs by .* rad RMS"):
        load_signal(*(Run.of(run, transmission) for run in free))
    short = [replace(run, phase_s=None, excitation=None).rows(run.time_s < 0.6 + run.time_s[0]) for run in pair]
    with pytest.raises(RecordingError, match=r"too short, 0\.59 s of motion; at least 1 s is required"):
        load_signal(*(Run.of(run, transmission) for run in short))
    for rate in (1.1, 1.003):
        slow = pinocchio_arm.run(pinocchio_arm.trajectory(), False, seed=1, rate=rate)
        with pytest.raises(RecordingError, match="same speed and with the same clock"):
            load_signal(Run.of(loaded, transmission), Run.of(slow, transmission))
    swapped = replace(unloaded, position_rad=unloaded.position_rad[:, [1, 0, 2, 3, 4, 5]])
    with pytest.raises(RecordingError, match="order of the joints"):
        load_signal(Run.of(loaded, transmission), Run.of(swapped, transmission))
    still = replace(unloaded, position_rad=np.zeros_like(unloaded.position_rad))
    with pytest.raises(RecordingError, match="no joint moves"):
        load_signal(Run.of(loaded, transmission), Run.of(still, transmission))
    small = replace(unloaded, position_rad=unloaded.position_rad[:, :3], current_a=unloaded.current_a[:, :3])
    with pytest.raises(RecordingError, match=r"6 joints.* has 3"):
        load_signal(Run.of(loaded, transmission), Run.of(small, Transmission(np.ones(3), np.eye(3))))


def test_the_start_of_a_run_is_not_in_its_average_period(pinocchio_arm):
    """The servos' lag is that of the approach until they have settled."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(), True, seed=1)
    elapsed = run.phase_s - run.phase_s[0]
    lag = 3e-3 * np.exp(-elapsed / 0.04) * (elapsed < 0.29)
    late = replace(run, position_rad=run.position_rad - lag[:, None], current_a=run.current_a + 1e3 * lag[:, None])
    expected, found = (Run.of(either, pinocchio_arm.transmission).motion for either in (run, late))
    np.testing.assert_array_equal(found.states.acceleration_rad_s2, expected.states.acceleration_rad_s2)
    np.testing.assert_array_equal(found.raw_nm, expected.raw_nm)
    assert found.valid.all()


def test_a_phase_without_samples_is_filled_between_its_neighbours_and_not_valid(pair, pinocchio_arm):
    run = pair[0]
    phases = phases_of(*periodic_phase(run))
    kept = run.rows(np.arange(run.size) % phases != 40)
    folded = fold(kept, joint_torque(kept, pinocchio_arm.transmission), phases)
    (hole,) = np.flatnonzero(~folded.valid)
    assert folded.valid.size == phases
    between = 0.5 * (folded.raw_nm[hole - 1] + folded.raw_nm[hole + 1])
    np.testing.assert_allclose(folded.raw_nm[hole], between, rtol=1e-9)
