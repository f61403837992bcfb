"""The shortest motion about a calibrated arm's present pose that determines the payload's mass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from armload_controller.analysis.arm_in_use import Calibration, arm_in_use
from armload_controller.analysis.robot_excitation import POSITION_MARGIN_RAD, DesignedMotion, design_envelope
from armload_controller.config.robot import Robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.checked_path import CheckedPath, check_path
from armload_controller.motion.slow_round_pace import PLANNED_SPEED_M_S
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.fourier import MASS_CRITERION, Excitation
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.excitation.information import condition_number
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError
from armload_identification.pipeline.mass_prospect import half_widths_kg
from armload_identification.pipeline.wiggle import Wiggle, WiggleSearch
from armload_identification.results.json_document import json_document

_WITHOUT_BUS_S: Final = 0.01
"""Time between setpoints for an arm without a `[bus]`."""


@dataclass(frozen=True, eq=False)
class DesignedWiggle(DesignedMotion):
    """A short motion that determines a mass, with its figures; prints as a few lines.

    Attributes:
        at_rad: (n,) the pose that the motion is centred on.
        wiggle: The motion and its predicted accuracy.
        envelope: The limits it was designed within.
        path: The motion, checked for execution.
        options: Options of `armload design` that reproduce it, without the output.
    """

    arm: Robot
    at_rad: FloatArray
    wiggle: Wiggle
    envelope: Envelope
    path: CheckedPath
    options: str

    @property
    def share(self) -> float:
        """Half width of the mass's 95 % interval divided by the expected mass."""
        return self.wiggle.half_width_kg / self.arm.payloads.expected.mass_kg

    @property
    def measured_s(self) -> float:
        """Duration of all periods and both ramps."""
        leg = self.path.measured.leg
        return leg.end_s - leg.start_s

    @property
    def amplitude_rad(self) -> FloatArray:
        """(n,) greatest distance of every joint from `at_rad`."""
        reach = self.wiggle.trajectory.bounds()
        return np.maximum(reach.position_max_rad - self.at_rad, self.at_rad - reach.position_min_rad)

    @property
    def speed_m_s(self) -> float:
        """Greatest speed of any point of the arm."""
        return float(self.arm.limits.points.greatest_on(self.wiggle.trajectory).max())

    def _excitation(self, output: str) -> Excitation:
        trajectory = self.wiggle.trajectory
        at = trajectory.evaluate(np.linspace(0.0, trajectory.period_s, 200, endpoint=False))
        design: dict[str, str | int | float] = {
            "criterion": MASS_CRITERION,
            "cost": self.share,
            "condition_number": condition_number(self.arm.chain).cost(*at[:3], trajectory.period_s),
            "seed": self.wiggle.seed,
            "restarts": self.wiggle.tried,
            "command": f"armload design {self.robot_argument} {self.options} --output {output}",
            "armload_version": version("armload"),
        }
        return Excitation(trajectory, self.wiggle.periods, design, (), self.envelope.margins(trajectory))

    def to_dict(self) -> dict[str, Any]:
        """The figures as numbers, texts, lists and dictionaries: the schema `armload/wiggle/1`."""
        wiggle = self.wiggle
        mass = {"expected_kg": float(self.arm.payloads.expected.mass_kg), "half_width_95_kg": wiggle.half_width_kg}
        motion = {"period_s": wiggle.trajectory.period_s, "periods": wiggle.periods, "measured_s": self.measured_s}
        run = {"slow_round_s": self.path.slow_round_s, "speed_m_s": self.speed_m_s}
        joints = [
            {"name": name, "at_rad": float(at), "amplitude_rad": float(size)}
            for name, at, size in zip(self.arm.joint_names, self.at_rad, self.amplitude_rad, strict=True)
        ]
        return json_document("wiggle", {"robot": self.arm.name} | mass | motion | run | {"joints": joints})

    def __str__(self) -> str:
        """Accuracy, duration and extent."""
        way = ", ".join(f"{np.degrees(size):.1f}" for size in self.amplitude_rad)
        wiggle = self.wiggle
        text = (
            f"{wiggle.periods} period{'' if wiggle.periods == 1 else 's'} of {wiggle.trajectory.period_s:g} s, "
            f"{self.measured_s:.1f} s with ramps, determine {self.arm.payloads.expected.mass_kg:g} kg "
            f"to within {wiggle.half_width_kg:.3g} kg, {100.0 * self.share:.1f} % (95 %, without drift)\n"
            f"joints move by {way} degrees about {np.round(self.at_rad, 3).tolist()} rad\n"
            f"limits, workspace and torque are always respected; no point of the arm is faster than "
            f"{self.speed_m_s:.2f} m/s; the preceding slow round takes {self.path.slow_round_s:.0f} s at "
            f"{PLANNED_SPEED_M_S:.3f} m/s at most, with what the arm carries"
        )
        return "\n".join((text, *self.arm.payloads.assumed_envelopes))


@dataclass(frozen=True)
class WiggleRequest:
    """What a short motion must determine, and where.

    Attributes:
        within_rad: Greatest distance of any joint from the pose.
        mass_share: Required half width of the mass's 95 % interval, divided by the mass.
        at_rad: (n,) the pose; if empty, the middle of the robot's excitation.
        speed_m_s: Speed that no point of the arm exceeds; if not given, the limit in the robot's file.
    """

    within_rad: float
    mass_share: float
    at_rad: tuple[float, ...] = ()
    speed_m_s: float | None = None


def design_wiggle(
    robot: Robot,
    request: WiggleRequest,
    *,
    calibration: Calibration | None = None,
    seed: int = 1,
    progress: Callable[[int, int], None],
) -> DesignedWiggle:
    """Find the shortest motion about a pose that determines the mass of the robot's expected payload.

    Args:
        request: What the motion must determine, and where.
        calibration: Calibration file of `armload calibrate`; if not given, the one that the robot's file names.
        seed: Seed of the random starts; the same seed gives the same motion.
        progress: Called with the steps done and their total.

    Raises:
        EstimationError: the arm is not calibrated.
        ConfigurationError: no pose is given or known, or the robot's file lacks data that a design needs.
        ExcitationError: no such motion keeps all limits, or none is accurate enough.
        BlockedWay: the approach from the pose to the motion is not free.
    """
    used = arm_in_use(robot, calibration)
    found = used.calibrated("predicting what a motion will determine requires the arm's calibration")
    at = _center_pose(robot, request.at_rad)
    envelope = _limits_about(robot, at, request)
    cycle_s = 1.0 / robot.bus.cycle_hz if robot.has_bus else _WITHOUT_BUS_S

    _require_gains(found, request.mass_share)
    expected = robot.payloads.expected
    prospect = partial(half_widths_kg, used.chain, found, expected)
    search = WiggleSearch(prospect, envelope, at, cycle_s, robot.obstacles.objection)
    wiggle = search.shortest(request.mass_share * expected.mass_kg, seed, progress)
    excitation = Excitation(wiggle.trajectory, wiggle.periods)
    path = check_path(excitation, robot.motion_constraints, cycle_s, file="the design", key="any-motion")
    path.approach_from(at)
    options = f"--for any-motion --within-deg {np.degrees(request.within_rad):g} --mass-within {request.mass_share:g}"
    options += f" --at-rad '{' '.join(f'{value:.6g}' for value in at)}' --seed {seed}"
    options += "" if request.speed_m_s is None else f" --speed-m-s {request.speed_m_s:g}"
    return DesignedWiggle(robot, at, wiggle, envelope, path, options)


def _require_gains(calibration: ArmCalibration, mass_share: float) -> None:
    """Raise if the gains are not known well enough for the required mass, whatever the motion.

    A mass is a combination of what the joints show, with weights w of sum 1, so its relative variance due to the gains
    is w^T C w >= 1 / (1^T C^-1 1).
    """
    n = calibration.n
    information = float(np.linalg.inv(calibration.covariance[:n, :n]).sum())
    least = NORMAL_HALF_WIDTH / np.sqrt(information)
    if mass_share >= least:
        return
    remedy = (
        "more runs with weighed payloads"
        if calibration.scale_weighed
        else "a weighed payload (mass_kg): without one, the scale of its gains is nominal"
    )
    raise ExcitationError(
        f"no motion determines the mass to {100.0 * mass_share:.2g} % (95 %), because the gains of the calibration are "
        f"known to {100.0 * least:.2g} % only. Calibrate the arm with {remedy}; or allow more with --mass-within."
    )


def _center_pose(robot: Robot, at_rad: Sequence[float]) -> FloatArray:
    """The pose that the motion is centred on."""
    excitation = robot.excitations.get("identification")
    if not len(at_rad) and excitation is not None:
        return excitation.trajectory.offset_rad
    at = np.asarray(at_rad, dtype=np.float64)
    if at.shape != (robot.n,) or not np.isfinite(at).all():
        why = "" if len(at_rad) else f", as {robot.file} has no excitation"
        expected = f"expected {robot.n} positions in rad{why}"
        raise ConfigurationError("the command line", "--at-rad", list(at_rad) or None, expected)
    return at


def _limits_about(robot: Robot, at: FloatArray, request: WiggleRequest) -> Envelope:
    """The robot's limits, restricted to a box about the pose."""
    whole = design_envelope(robot)
    joints = whole.joints
    low, high = joints.position_min_rad, joints.position_max_rad
    outside = np.flatnonzero((at <= low) | (at >= high))
    if outside.size:
        joint = int(outside[0])
        raise ExcitationError(
            f"{robot.joint_names[joint]} is at {at[joint]:.3f} rad; expected between {low[joint]:.3f} and "
            f"{high[joint]:.3f}, {POSITION_MARGIN_RAD} rad from its limits, the margin that motions keep"
        )
    about = replace(
        joints,
        position_min_rad=np.maximum(low, at - request.within_rad),
        position_max_rad=np.minimum(high, at + request.within_rad),
    )
    speed = whole.speed
    if request.speed_m_s is not None and (speed is None or request.speed_m_s < speed.speed_m_s):
        speed = SpeedLimit(robot.limits.points, request.speed_m_s)
    return replace(whole, joints=about, speed=speed)
