"""Holding test of the brakes: the drives are enabled with their brakes closed, and push against them one by one.

    rest -> torque offset in one direction -> rest -> in the other -> the next joint

The offset (60B2) passes the torque gate, as all added torque; the setpoint does not move. A brake that holds takes the
offset: the motor's torque rises by it, and the joint stands still. If it does not hold, or the drive opens it, the
servo's loop takes the joint back to its setpoint: the motor's torque returns to what it was, and the joint has moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.torque_monitor import measured_torque
from armload_controller.session.run_session import RunSession
from armload_identification.float_array import FloatArray
from armload_identification.signals.joint_torque import Transmission

TRIED_SHARE = 0.1
"""Share of the greatest torque that may be added to a joint: more than its friction, less than its brake must hold."""
PUSH_S, REST_S = 1.6, 1.0
"""Time of one push, ramps of the gate included, and of the rest after it."""
MEASURED_S = 0.3
"""Time at the end of a push or a rest over which is averaged."""
LEAST_RESPONSE = 0.7
"""Least share of the offset that the motor must show against a brake that holds."""
MOST_MOVED_RAD = 0.004
"""Greatest motion of the joint: play of the brake, and the gear's elasticity."""


@dataclass(frozen=True)
class BrakeFinding:
    """Result for one joint.

    Attributes:
        joint: Its name.
        tried_nm: The torque, in either direction; 0 if it was not tried, because the axis has no brake.
        response: Share of it that the motor showed, the lesser of both directions.
        moved_rad: Greatest motion.
    """

    joint: str
    tried_nm: float
    response: float
    moved_rad: float

    @property
    def holds(self) -> bool:
        """Whether the brake holds; also False if it could not be shown."""
        return self.tried_nm > 0.0 and self.response >= LEAST_RESPONSE and self.moved_rad <= MOST_MOVED_RAD


class BrakeTest:
    """Plug-in that pushes against the brakes of a standing arm.

    Args:
        transmission: Converts motor current to joint torque.
        tried_nm: (n,) torque of each joint; 0 for one that is not tried.
        cycle_s: Duration of a cycle.
    """

    name = "brake test"

    def __init__(
        self, joint_names: Sequence[str], transmission: Transmission, tried_nm: FloatArray, cycle_s: float
    ) -> None:
        self._names, self._transmission, self._tried_nm = joint_names, transmission, tried_nm
        self._rest, self._push = round(REST_S / cycle_s), round(PUSH_S / cycle_s)
        self._measured = max(1, round(MEASURED_S / cycle_s))
        self._phases = [(joint, sign) for joint in np.flatnonzero(tried_nm) for sign in (0.0, 1.0, 0.0, -1.0)]
        self._means: list[tuple[float, float]] = []
        self._rows: list[tuple[float, float]] = []

    def on_cycle(self, step: CycleStep) -> FloatArray | None:
        """Push, rest, and measure."""
        if self.done():
            return None
        joint, sign = self._phases[len(self._means)]
        torque_nm = measured_torque(step.feedback, self._transmission)
        self._rows.append((float(torque_nm[joint]), float(step.feedback.position_rad[joint])))
        if len(self._rows) == (self._push if sign else self._rest):
            torque, position = np.mean(self._rows[-self._measured :], axis=0)
            self._means.append((float(torque), float(position)))
            self._rows = []
        wanted_nm = np.zeros_like(self._tried_nm)
        wanted_nm[joint] = sign * self._tried_nm[joint]
        return wanted_nm

    def done(self) -> bool:
        """Whether every joint has been tried."""
        return len(self._means) == len(self._phases)

    def findings(self) -> tuple[BrakeFinding, ...]:
        """The result for every joint, in order."""
        means, found = iter(self._means), []
        for name, tried_nm in zip(self._names, self._tried_nm.tolist(), strict=True):
            if not tried_nm:
                found.append(BrakeFinding(name, 0.0, 0.0, 0.0))
                continue
            rest, forth, between, back = (next(means) for _ in range(4))
            response = min((forth[0] - rest[0]) / tried_nm, (between[0] - back[0]) / tried_nm)
            moved = max(abs(forth[1] - rest[1]), abs(back[1] - between[1]))
            found.append(BrakeFinding(name, tried_nm, response, moved))
        return tuple(found)


def brakes_tried(session: RunSession) -> tuple[BrakeFinding, ...]:
    """Try the brakes of an arm that was opened with its brakes closed; asks for consent.

    Raises:
        CommissioningError: the operator does not agree.
        MotionError: the test was stopped, or the arm could not be enabled.
    """
    robot = session.robot
    drives = robot.drives.settings.drives
    braked = np.array([drive.has_brake and drive.torque_offset for drive in drives])
    tried_nm = TRIED_SHARE * robot.limits.added_torque_max_nm * braked
    test = BrakeTest(robot.joint_names, robot.drives.transmission, tried_nm, 1 / robot.bus.cycle_hz)
    session.hold(
        [test],
        lambda hold: hold(test.done),
        warning="Its brakes stay closed, and each motor pushes against its own in both directions. If a brake does not "
        "hold, its joint moves a little. ",
    )
    return test.findings()
