"""Progress of a calibration: reading is its first half, the fit its second."""

import pytest

from armload_controller.analysis import robot_calibration
from armload_controller.analysis.robot_calibration import calibrate
from armload_controller.config.robot import load_robot


@pytest.mark.parametrize("shown", [True, False])
def test_each_half_is_shown_as_a_hundred_steps(monkeypatch, shown):
    robot, steps, given = load_robot("er50"), [], []

    def read_runs(arm, runs, progress):
        given.append((arm, runs))
        for done in (1, 3) if progress else ():
            progress(done, 3)
        return "runs"

    def calibrate_arm(runs, chain, transmission, *, robot, made, progress):
        given.append((runs, robot))
        for done in (0, 2) if progress else ():
            progress(done, 2)
        return "calibration"

    monkeypatch.setattr(robot_calibration, "read_runs", read_runs)
    monkeypatch.setattr(robot_calibration, "calibrate_arm", calibrate_arm)
    found = calibrate(robot, "runs.csv", progress=(lambda *step: steps.append(step)) if shown else None)
    assert steps == ([(33, 200), (100, 200), (100, 200), (200, 200)] if shown else [])
    assert given == [(robot, ["runs.csv"]), ("runs", "er50")]
    assert found.calibration == "calibration"
    assert (found.description, found.joint_names) == (robot.description, robot.joint_names)
