"""Every row of the decision table on the simulated arm: it stays near its path and comes to rest."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.stop_decisions import Cause, StopCategory
from benchmarks.canopen_runs import stops
from benchmarks.canopen_runs.stops import measure, one_period

BOUNDS = {
    # Distance from the path in rad (7e-3 of it is the drives' lag), time to standstill in s.
    StopCategory.ALONG_PATH: (7e-3, 1.4),
    # Each axis slows down on its own: elsewhere on this path a quick stop leaves it further (STOPS.md).
    StopCategory.QUICK_STOP: (9e-3, 0.65),
    StopCategory.TORQUE_OFF: (9e-3, 0.6),
    # One joint runs away until it has no torque and its brake holds.
    StopCategory.EMERGENCY_STOP: (0.2, 0.6),
}
BRAKED = (80e-3, 0.6)
"""A drive in FAULT has no torque: its brake stops one joint, after its delay, while the others slow down."""
WATCHED = (60e-3, 2.0)
"""A monitor that compares over a window detects only after that time, elsewhere on the path."""
OTHERS = {Cause.DRIVE_FAULT: BRAKED, Cause.VELOCITY: WATCHED}


@pytest.fixture(scope="module", params=[125.0, pytest.param(250.0, marks=pytest.mark.long)], ids=["half rate", "rate"])
def er50(request):
    """At its nominal rate and at half of it: the bounds hold for both."""
    robot = load_robot("er50").with_bus(cycle_hz=request.param)
    return robot, one_period(robot)


@pytest.mark.parametrize("cause", Cause, ids=lambda cause: cause.name.lower())
def test_the_arm_stays_near_its_path_and_stands(er50, cause):
    stop = measure(*er50, cause)
    deviation_rad, standstill_s = OTHERS.get(cause, BOUNDS[cause.category])
    assert stop.deviation_rad < deviation_rad
    assert 0.0 < stop.standstill_s < standstill_s
    assert stop.message.startswith(f"Motion stopped ({cause.category.title}): {cause.words}")
    assert cause.advice in stop.message
    assert "While stopping" not in stop.message


def test_a_quick_stop_leaves_the_path_by_no_more_than_the_page_says(monkeypatch):
    robot = load_robot("er50").with_bus(cycle_hz=125.0)
    path, greatest_rad = one_period(robot), []
    for at_s in np.arange(0.3, path.excitation.trajectory.period_s - 0.2, 0.25):
        monkeypatch.setattr(stops, "AT_S", float(at_s))
        stop = measure(robot, path, Cause.LATE)
        greatest_rad.append(stop.deviation_rad)
        assert 0.0 < stop.standstill_s < BOUNDS[StopCategory.QUICK_STOP][1]
    assert max(greatest_rad) == pytest.approx(62e-3, abs=1e-3)
