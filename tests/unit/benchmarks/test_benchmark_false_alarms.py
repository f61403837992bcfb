"""In the benchmark of false alarms the monitors get the same data as in a run of each seed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from armload_controller.cycle.feedback_truth import IDLE_RAD
from armload_controller.cycle.torque_monitor import TorqueError
from armload_controller.session.session_load import SessionLoad
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.canopen_runs.false_alarms import _chance_of_a_stretch, judge, moved, replayed, seed_of
from tests.short_commissioning import MIDDLE_RAD, least_robot

ROBOT = least_robot()


def ran(seed):
    spec = replace(twin_spec(ROBOT, Twin.HARSH, None), seed=seed, start_position_rad=MIDDLE_RAD)
    one = {"validation": ROBOT.excitations["validation"]}
    motions, plant, stops = moved(ROBOT, SessionLoad.UNLOADED, spec, one)
    assert stops == []
    return motions, plant


@pytest.fixture(scope="module")
def first():
    return ran(seed_of(0, SessionLoad.UNLOADED))


def test_a_replay_is_the_run_of_that_seed(first):
    motions, plant = first
    seed = seed_of(7, SessionLoad.UNLOADED)
    (replay,), ((direct,), _) = replayed(ROBOT, plant, motions, seed), ran(seed)
    assert len(replay) == len(direct.steps) > 200
    for name in ("time_s", "position_rad", "torque_nm", "statusword"):
        found, expected = (
            [getattr(each, name) for each in run] for run in (replay, [s.feedback for s in direct.steps])
        )
        np.testing.assert_array_equal(found, expected)
    assert [step.command.position_rad.tolist() for step in motions[0].steps] == [
        step.command.position_rad.tolist() for step in direct.steps
    ]
    assert np.ptp(
        [step.feedback.torque_nm - seen.torque_nm for step, seen in zip(motions[0].steps, replay, strict=True)]
    )


def test_what_should_stop_a_run_does_so_in_a_replay(first):
    motions, plant = first
    (replay,) = replayed(ROBOT, plant, motions, 1)
    judge(ROBOT, SessionLoad.UNLOADED, motions[0], replay)
    strong = [feedback._replace(torque_nm=feedback.torque_nm + 1e3) for feedback in replay]
    with pytest.raises(TorqueError):
        judge(ROBOT, SessionLoad.UNLOADED, motions[0], strong)


def test_the_chance_of_an_idling_alarm_is_that_of_many_runs():
    """Few coarse counts and little noise, so that it is not rare."""
    rng = np.random.default_rng(0)
    position, noise = np.linspace(0.0, 1.0, 60), 1.5
    chance = np.log(np.full(60, erf(0.5 / noise / np.sqrt(2.0)))).cumsum()
    zero = np.abs(noise * rng.standard_normal((20000, 60))) < 0.5
    alarms = 0
    for run in zero:
        since = position[0]
        for q, idle in zip(position, run, strict=True):
            since = since if idle else q
            if abs(q - since) > IDLE_RAD:
                alarms += 1
                break
    bound = _chance_of_a_stretch(position, chance)
    assert 0.5 * bound < alarms / len(zero) < bound
