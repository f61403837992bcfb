"""An arm whose robot file is wrong: simulated, and seen through one mistake of the file.

With the file's positions q and the arm's own p of the axes,

    p = A q + d,        reported torque = T (torque of the arm)

where A scales, reverses or exchanges joints, d displaces a zero, and T scales or reverses torques. A base that is not
level tilts gravity in the arm itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, radians, sin

import numpy as np

from armload_controller.config.robot import Robot
from armload_drivers.simulation.mujoco_plant import ArmPlant, PlantSample
from armload_drivers.simulation.plant_interface import EncoderFault
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False)
class Mistake:
    """A mistake in a robot's file.

    Attributes:
        name: Description.
        joints: Joints that a finding must name; empty for the whole arm.
        position: (n, n) A above.
        zero_rad: (n,) d above.
        torque: (n, n) T above.
        tilt_deg: Tilt of the base about its x axis.
    """

    name: str
    joints: tuple[int, ...]
    position: FloatArray
    zero_rad: FloatArray
    torque: FloatArray
    tilt_deg: float = 0.0

    @classmethod
    def none(cls, n: int, name: str = "none", joints: tuple[int, ...] = ()) -> Mistake:
        """No mistake; the start of every other one."""
        return cls(name, joints, np.eye(n), np.zeros(n), np.eye(n))


def scaled_torque(n: int, joint: int, factor: float) -> Mistake:
    """A torque that is reported `factor` times as great."""
    torque = np.eye(n)
    torque[joint, joint] = factor
    return replace(Mistake.none(n, f"torque x {factor:g}", (joint,)), torque=torque)


def reversed_axis(n: int, joint: int) -> Mistake:
    """An axis that turns the other way, with its torque."""
    flip = np.eye(n)
    flip[joint, joint] = -1.0
    return replace(Mistake.none(n, "axis reversed", (joint,)), position=flip, torque=flip)


def scaled_gear(n: int, joint: int, factor: float) -> Mistake:
    """A joint that turns `factor` times as far as the file's gear ratio says, with a torque reported accordingly."""
    position, torque = np.eye(n), np.eye(n)
    position[joint, joint], torque[joint, joint] = factor, factor
    return replace(Mistake.none(n, f"gear ratio x {factor:g}", (joint,)), position=position, torque=torque)


def displaced_zero(n: int, joint: int, zero_rad: float) -> Mistake:
    """A joint whose zero is elsewhere."""
    zero = np.zeros(n)
    zero[joint] = zero_rad
    return replace(Mistake.none(n, f"zero off by {zero_rad:g} rad", (joint,)), zero_rad=zero)


def exchanged(n: int, one: int, other: int) -> Mistake:
    """Two joints whose drives are exchanged."""
    order = list(range(n))
    order[one], order[other] = other, one
    return replace(
        Mistake.none(n, "exchanged joints", (one, other)), position=np.eye(n)[order], torque=np.eye(n)[order]
    )


def tilted_base(n: int, tilt_deg: float) -> Mistake:
    """A base that is not mounted as the file says."""
    return replace(Mistake.none(n, f"base tilted by {tilt_deg:g} degrees"), tilt_deg=tilt_deg)


class MisreadPlant:
    """A simulated arm as it appears through a wrong file; a `Plant`.

    Args:
        spec: The arm as it is.
        mistake: What the file has wrong.

    Attributes:
        n: Number of axes.
    """

    def __init__(self, spec: PlantSpec, mistake: Mistake) -> None:
        tilt = radians(mistake.tilt_deg)
        turned = np.array([[1.0, 0.0, 0.0], [0.0, cos(tilt), -sin(tilt)], [0.0, sin(tilt), cos(tilt)]])
        start = mistake.position @ spec.start_position_rad + mistake.zero_rad
        self._arm = ArmPlant(replace(spec, gravity_m_s2=turned.T @ spec.gravity_m_s2, start_position_rad=start))
        self.n = self._arm.n
        self._mistake, self._to_file = mistake, np.linalg.inv(mistake.position)
        self._drive = [int(np.abs(mistake.position[:, axis]).argmax()) for axis in range(self.n)]

    @property
    def time_s(self) -> float:
        """Time that the arm has been advanced to."""
        return self._arm.time_s

    def advance(self, time_s: float) -> None:
        """Advance to a time."""
        self._arm.advance(time_s)

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move the setpoint of the axis that the file means."""
        drive, mistake = self._drive[axis], self._mistake
        self._arm.set_target(drive, mistake.position[drive, axis] * position_rad + mistake.zero_rad[drive], over_s)

    def slow_down(self, axis: int, over_s: float) -> None:
        """Slow down the axis that the file means."""
        self._arm.slow_down(self._drive[axis], over_s)

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add torque to the axis that the file means."""
        self._arm.set_torque_offset(self._drive[axis], torque_nm)

    def set_powered(self, axis: int, on: bool) -> None:
        """Switch the axis that the file means."""
        self._arm.set_powered(self._drive[axis], on)

    def hold_by_brake(self, axis: int) -> None:
        """Brake the axis that the file means."""
        self._arm.hold_by_brake(self._drive[axis])

    def fail_encoder(self, axis: int, fault: EncoderFault) -> None:
        """Let the encoder fail of the axis that the file means."""
        self._arm.fail_encoder(self._drive[axis], fault)

    def hold_position(self, axis: int) -> float:
        """Position of an axis, as the file has it."""
        drive = self._drive[axis]
        found = self._arm.hold_position(drive) - self._mistake.zero_rad[drive]
        return float(found * self._to_file[axis, drive])

    def sample(self, cycle_s: float) -> PlantSample:
        """Measure, as the file has it."""
        found, mistake, to_file = self._arm.sample(cycle_s), self._mistake, self._to_file
        return replace(
            found,
            axis_position_rad=to_file @ (found.axis_position_rad - mistake.zero_rad),
            axis_velocity_rad_s=to_file @ found.axis_velocity_rad_s,
            axis_demand_rad=to_file @ (found.axis_demand_rad - mistake.zero_rad),
            axis_torque_nm=mistake.torque @ found.axis_torque_nm,
        )


def mistakes(robot: Robot) -> list[Mistake]:
    """The mistakes that are tried with every arm, one or two joints at a time."""
    n = robot.n
    return [
        Mistake.none(n),
        *(scaled_torque(n, joint, 0.7) for joint in range(n)),
        *(reversed_axis(n, joint) for joint in range(n)),
        *(scaled_gear(n, joint, factor) for factor in (0.8, 1.25) for joint in range(n)),
        *(exchanged(n, joint, joint + 1) for joint in range(n - 1)),
        *(displaced_zero(n, joint, zero) for zero in (0.2, -0.2) for joint in range(n)),
        *(tilted_base(n, angle) for angle in (5.0, 30.0)),
    ]
