"""Seeded recordings compared with the same arm streamed through FakeServos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.motion.setpoints import Segment, plan_measured
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import Excitation
from armload_identification.model.regressor import payload_torque
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.setups import Motion, Twin, setup_of, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import Streaming, steady_period
from benchmarks.arms.streamed_arm import noiseless
from benchmarks.arms.trials import identified, trial
from benchmarks.results.error_statistics import Census, Errors
from tests.fake_servos import FakeServos
from tests.planned_leg import plan_leg

pytest.importorskip("mujoco")

ROBOT = load_robot("er50")
ARM = replace(ROBOT.drives.settings, cycle_s=0.01)
TRAJECTORY = ROBOT.excitations["identification"].trajectory
STREAMING = Streaming(ARM, ROBOT.limits.motion)
PAYLOAD = ROBOT.simulation.plant_spec("paper").payload
PERIODS = 2


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache for this module."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def setup(cache):
    motion = Motion(TRAJECTORY, STREAMING, ROBOT.n, PERIODS)
    return setup_of("test", ROBOT, Twin.NORMATIVE, motion, PAYLOAD)


def streamed(spec, periods):
    """(N, n) position and reported effort over complete periods, through FakeServos."""
    plan = plan_leg(plan_measured(Excitation(TRAJECTORY, periods), STREAMING.limits, ARM.cycle_s), ARM.cycle_s)
    servos = FakeServos(ARM, ArmPlant(replace(spec, start_position_rad=plan.position_rad[0])))
    servos.connect()
    servos.enable()
    nothing = np.zeros(ROBOT.n)
    kept = []
    for row, segment in enumerate(plan.segment):
        feedback = servos.exchange(JointCommand(plan.position_rad[row], nothing, nothing))
        if segment is Segment.PERIODS:
            kept.append((feedback.position_rad, feedback.current_a))
    position, current = np.array(kept).transpose(1, 0, 2)
    return position, current


def test_without_noise_a_recording_is_what_fake_servos_tell(setup):
    spec = noiseless(twin_spec(ROBOT, Twin.NORMATIVE, PAYLOAD))
    position, current = streamed(spec, 2)
    silent = replace(setup.scales, noise_nm=np.zeros(6))
    made = record(setup.loaded, silent, 1, np.random.default_rng(0), np.zeros(6))
    second = slice(len(made.time_s), None)
    step_a = setup.scales.effort_per_unit
    # The two arms differ by one cycle of waiting before the start, which may show in the rounding.
    assert np.abs(made.current_a - current[second]).max() <= step_a.max() * 1.01
    assert np.mean(np.abs(made.current_a - current[second]) > 0.5 * step_a) < 1e-3
    assert np.abs(made.position_rad - position[second]).max() < 1e-6


@pytest.mark.long
def test_a_seed_agrees_with_fake_servos_within_its_interval(setup):
    runs = []
    for load, seed in ((PAYLOAD, 21), (None, 22)):
        spec = replace(twin_spec(ROBOT, Twin.NORMATIVE, load), seed=seed)
        position, current = streamed(spec, PERIODS)
        template = record(setup.loaded, setup.scales, PERIODS, np.random.default_rng(seed), np.zeros(6))
        runs.append(replace(template, position_rad=position, current_a=current))
    over_servos = identify_runs(*runs, setup.chain, setup.transmission)
    seeded = identified(setup, 1)
    apart = np.abs(over_servos.parameters.values - seeded.parameters.values)
    both = np.hypot(over_servos.uncertainty.half_width_95, seeded.uncertainty.half_width_95)
    known = over_servos.uncertainty.determined & seeded.uncertainty.determined
    assert known[:4].all()
    assert (apart[known] <= both[known]).all()
    np.testing.assert_allclose(over_servos.signal.noise_nm, seeded.signal.noise_nm, rtol=0.1)


def test_a_gain_error_is_what_the_plant_makes_of_it(setup):
    error = np.array([0.02, -0.02, 0.015, -0.01, 0.02, -0.02])
    spec = replace(noiseless(twin_spec(ROBOT, Twin.NORMATIVE, PAYLOAD)), torque_gain_error=error)
    current = streamed(spec, 2)[1][setup.loaded.samples :]
    silent = replace(setup.scales, noise_nm=np.zeros(6))
    made, plain = (record(setup.loaded, silent, 1, np.random.default_rng(0), e).current_a for e in (error, 0.0 * error))
    apart, size, without = (np.sqrt(np.mean(x**2, axis=0)) for x in (made - current, current, plain - current))
    assert (apart < 0.004 * size).all()
    assert (apart < 0.4 * without).all()


def test_the_noise_follows_the_rate(setup):
    scales = setup.scales
    runs = [
        record(replace(setup.loaded, sample_s=sample_s), scales, 30, np.random.default_rng(7), np.zeros(6))
        for sample_s in (0.01, 0.0025)
    ]
    sigma = [run.current_a.reshape(30, -1, 6).std(axis=0, ddof=1).mean(axis=0) for run in runs]
    np.testing.assert_allclose(sigma[1] / sigma[0], 2.0, rtol=0.02)
    np.testing.assert_allclose(
        sigma[0] / scales.effort_per_unit / scales.effort_units_per_nm, scales.noise_nm, rtol=0.03
    )


def test_a_period_repeats_and_no_drive_is_at_its_limit(setup):
    for period in (setup.loaded, setup.unloaded):
        assert period.unrepeated_nm.max() < 1e-3
        assert period.greatest_share.max() < 0.9
    again = steady_period(twin_spec(ROBOT, Twin.NORMATIVE, PAYLOAD), STREAMING, TRAJECTORY)
    np.testing.assert_array_equal(again.axis_torque_nm, setup.loaded.axis_torque_nm)


@pytest.mark.long
def test_a_seed_is_the_same_twice_and_another_is_not(setup):
    one, again, other = trial(setup, 4), trial(setup, 4), trial(setup, 5)
    np.testing.assert_array_equal(one.theta, again.theta)
    assert not np.array_equal(one.theta, other.theta)
    assert not np.array_equal(one.theta, trial(replace(setup, name="another"), 4).theta)


def test_coupled_axes_cannot_be_taken_alone():
    assert DriveScales.of(ARM, ROBOT.limits.torque_noise_nm, 3).n == 3
    with pytest.raises(ValueError, match="coupled"):
        DriveScales.of(ARM, ROBOT.limits.torque_noise_nm, 5)


def test_a_refused_seed_counts_against_every_share(setup):
    good = trial(setup, 0)
    refused = trial(replace(setup, loaded=setup.unloaded, unloaded=setup.loaded), 0)
    assert refused.refused
    errors = Errors.of([good, refused], setup.truth)
    assert errors.share(np.abs(errors.mass_share) < 1.0) == 0.5
    census = Census()
    census.add([good, refused], setup.truth, "exact")
    census.add([good], setup.truth, None)
    assert (census.results, census.refused, census.impossible) == (2, 1, 0)
    assert census.intervals["exact"][0] == np.count_nonzero(good.determined)


def test_what_is_called_white_noise_alone_is_the_payload_and_nothing_else(cache):
    setup = setup_of("test", ROBOT, Twin.CLEAN, Motion(TRAJECTORY, STREAMING, ROBOT.n, PERIODS), PAYLOAD)
    difference = (setup.loaded.axis_torque_nm - setup.unloaded.axis_torque_nm) @ np.linalg.inv(ARM.coupling)
    state = TRAJECTORY.evaluate(np.arange(setup.loaded.samples) * setup.loaded.sample_s)
    expected = payload_torque(
        setup.chain, setup.truth.theta, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
    )
    np.testing.assert_allclose(difference, expected, atol=1e-9)
    np.testing.assert_allclose(setup.loaded.axis_position_rad @ ARM.coupling.T, state.position_rad, atol=1e-12)
