"""Many runs of an arm: their order, what changed and since when, and friction that falls as the arm warms up."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.calibration.run_health import Compared, FrictionOverTime, RunHealth
from armload_identification.pipeline.arm_drift import Monitored, arm_drift

pytestmark = pytest.mark.pure

N = 2
ARM = SimpleNamespace(n=N, friction_nm=np.array([40.0, 10.0]), usual_change_nm=np.array([1.0, 0.3]))
MORNING = datetime(2026, 3, 2, 6, tzinfo=UTC)


def compared(value, noise, doubt):
    return Compared(value, np.full(N, noise), np.full(N, doubt))


def run(number, moment=None, gain=0.0, friction=0.0, residual=1.0, course=None):
    draw = np.random.default_rng(number).normal
    return RunHealth(
        name=f"{number}.mcap",
        recorded="" if moment is None else moment.isoformat(),
        length_s=30.0 if course is None else 3600.0,
        carried="nothing",
        gain=compared(gain + 0.003 * draw(size=N), 0.002, 0.002),
        friction=compared(friction + np.array([0.5, 0.1]) * draw(size=N), 0.1, 0.3),
        residual=compared(np.log(residual) + 0.1 * draw(size=N), 0.1, 0.005),
        course=course,
    )


def test_what_changed_is_named_with_its_day():
    days = [MORNING + timedelta(days=day) for day in range(20)]
    runs = [
        run(number, day, gain=np.array([0.0, -0.04]) * (number >= 12), friction=6.0 * (number >= 7))
        for number, day in enumerate(days)
    ]
    mixed = [runs[i] for i in np.random.default_rng(1).permutation(len(runs))]
    drift = arm_drift(ARM, mixed)
    assert [one.name for one in drift.runs] == [one.name for one in runs]
    assert {(found.joint, found.quantity, found.run) for found in drift.findings} == {
        (0, Monitored.FRICTION, 7),
        (1, Monitored.FRICTION, 7),
        (1, Monitored.GAIN, 12),
    }
    assert drift.findings[0].text.endswith("higher since 2026-03-09 06:00")
    assert drift.findings[-1].text.startswith("joint 2: the gain is 4.")
    assert drift.findings[-1].text.endswith("% lower since 2026-03-14 06:00")
    assert drift.out_of_date


def test_friction_alone_leaves_the_calibration_valid_and_undated_runs_keep_their_order():
    runs = [run(number, friction=6.0 * (number >= 5)) for number in range(12)]
    drift = arm_drift(ARM, runs)
    assert not drift.out_of_date
    assert drift.began == ()
    assert {found.quantity for found in drift.findings} == {Monitored.FRICTION}
    assert all(found.text.endswith("since run 6 (5.mcap)") for found in drift.findings)


def test_what_stays_unexplained_is_a_ratio_and_one_run_alone_is_said_to_be_so():
    runs = [run(number, residual=8.0 if number == 6 else 1.0) for number in range(12)]
    drift = arm_drift(ARM, runs)
    assert not drift.out_of_date
    assert {(found.quantity, found.run, found.alone) for found in drift.findings} == {(Monitored.RESIDUAL, 6, True)}
    assert "times higher than in the neighbouring runs, in run 7 (6.mcap) alone" in drift.findings[0].text
    later = arm_drift(ARM, [run(number, residual=3.0) for number in range(12)])
    assert later.out_of_date
    assert all(found.text.endswith("times higher in all runs than in the calibration") for found in later.findings)


def test_a_joint_that_does_not_move_is_left_out():
    runs = [run(number) for number in range(6)]
    for one in runs:
        one.gain.value[0] = one.gain.noise[0] = one.gain.doubt[0] = np.nan
    drift = arm_drift(ARM, runs)
    assert drift.findings == ()
    assert np.isnan(drift.charts[Monitored.GAIN][0].level).all()


def warming(at_work_s):
    return np.array([-4.0, 0.0]) * (np.log1p(at_work_s / 600.0) - np.log1p(6.0))


def test_a_cold_arm_in_the_morning_is_no_change():
    """Five runs a day, the first one cold: friction follows the logarithm of the time in operation."""
    runs = []
    for number in range(30):
        at_work = timedelta(minutes=[0, 10, 30, 60, 120][number % 5])
        moment = MORNING + timedelta(days=number // 5) + at_work
        runs.append(run(number, moment, friction=warming(at_work.total_seconds() + 15.0)))
    drift = arm_drift(ARM, runs)
    assert drift.findings == ()
    assert drift.warming.slope_nm[0] == pytest.approx(-4.0, abs=0.3)
    assert drift.warming.slope_nm[1] == 0.0
    np.testing.assert_allclose(drift.warming.of_runs_nm[:5, 0], drift.warming.of_runs_nm[5:10, 0])
    assert drift.warming.session.max() == 5


def test_one_long_run_shows_the_warm_up_curve():
    elapsed = np.arange(30.0, 3600.0, 60.0)
    friction = np.stack([warming(t) for t in elapsed]) + 0.2 * np.random.default_rng(1).normal(size=(60, N))
    course = FrictionOverTime(elapsed, friction, np.full((60, N), 0.2))
    drift = arm_drift(ARM, [run(0, course=course)])
    np.testing.assert_allclose(drift.warming.slope_nm, [-4.0, 0.0], atol=0.2)
    assert drift.warming.curve_nm(np.array([3600.0]))[0, 0] == pytest.approx(0.0)
    assert arm_drift(ARM, [run(0), run(1)]).warming is None
