"""An arm from a URDF, simulated by Pinocchio: the flange's pose, and recordings empty and with a payload.

It uses none of this project's kinematics or dynamics, so it can serve as their reference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

RATE_HZ = 100.0
PERIODS = 2
HARMONICS = 5
BASE_HZ = 0.1
_RANGE_SHARE = 0.7
_SPEED_SHARE = 0.7
_FEW_RAD_S = 1.0
"""Greatest speed if the file has none or an implausible one."""
_FRICTION_SHARE = 0.15
_NOISE_SHARE = 0.005
"""Coulomb friction and noise of one sample, as a share of a joint's RMS torque."""
PUBLISHED = {
    "UR3": ("ur_description/urdf/ur3_robot.urdf", None, None),
    "UR5": ("ur_description/urdf/ur5_robot.urdf", None, None),
    "UR10": ("ur_description/urdf/ur10_robot.urdf", None, None),
    "Panda": ("panda_description/urdf/panda.urdf", None, "panda_hand"),
    "Kinova": ("kinova_description/robots/kinova.urdf", None, "j2s6s200_end_effector"),
    "xArm7": ("xarm_description/urdf/xarm7.urdf", None, "link_eef"),
    "Z1": ("z1_description/urdf/z1.urdf", None, "link06"),
    "SO-100": ("so_arm_description/urdf/so100.urdf", None, "gripper"),
    "SO-101": ("so_arm_description/urdf/so101.urdf", None, "gripper_link"),
    "Baxter": ("baxter_description/urdf/baxter.urdf", None, "left_gripper"),
    "Tiago": ("tiago_description/robots/tiago.urdf", "torso_lift_link", "arm_tool_link"),
    "Talos": ("talos_data/robots/talos_left_arm.urdf", None, "wrist_left_ft_tool_link"),
}
"""File among PyPI's `example-robot-data`, and links of base and flange; None for the file's."""


@dataclass
class SimulatedRun:
    """One run: (N,) times, (N, n) positions and torques."""

    time_s: np.ndarray
    position_rad: np.ndarray
    torque_nm: np.ndarray


class PinocchioArm:
    """The named joints, from base to flange; all others are held at zero."""

    def __init__(self, path: Path, joint_names: Sequence[str], base: str, flange: str) -> None:
        self.model = pin.buildModelFromUrdf(str(path))
        self.joint_names, self.base, self.flange = tuple(joint_names), base, flange

    def configuration(self, q: np.ndarray, model: pin.Model | None = None) -> np.ndarray:
        """Pinocchio's configuration for joint angles in the order of the names."""
        model = model or self.model
        full = pin.neutral(model)
        for name, angle in zip(self.joint_names, q, strict=True):
            which = model.joints[model.getJointId(name)]
            full[which.idx_q : which.idx_q + which.nq] = [angle] if which.nq == 1 else [np.cos(angle), np.sin(angle)]
        return full

    def flange_pose(self, q):
        """(4, 4) pose of the flange in the base frame."""
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, self.configuration(q))
        base, flange = (data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)] for link in (self.base, self.flange))
        return (base.inverse() * flange).homogeneous

    def loaded(self, mass_kg: float, center_m: np.ndarray, inertia_kg_m2: np.ndarray) -> pin.Model:
        """Pinocchio's model with a body on the flange."""
        model = pin.Model(self.model)
        frame = model.frames[model.getFrameId(self.flange, pin.FrameType.BODY)]
        body = pin.Inertia(mass_kg, np.array(center_m), np.array(inertia_kg_m2))
        model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
        return model

    @property
    def places(self) -> list[int]:
        """Places of the joints in Pinocchio's velocities and torques."""
        return [self.model.joints[self.model.getJointId(name)].idx_v for name in self.joint_names]

    def link_torque(self, model: pin.Model, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """(N, n) torque of the links of `model` or `loaded`, by Newton and Euler."""
        data, places = model.createData(), self.places
        torque, moved = np.empty_like(q), np.zeros((2, model.nv))
        for k in range(len(q)):
            moved[0, places], moved[1, places] = dq[k], ddq[k]
            torque[k] = pin.rnea(model, data, self.configuration(q[k], model), moved[0], moved[1])[places]
        return torque

    def runs(self, lower, upper, speed, mass_kg, center_m, inertia_kg_m2, seed=0):
        """An empty run and one with a payload, of one motion within the limits, with friction and noise.

        Returns:
            The loaded and the empty run.
        """
        rng = np.random.default_rng(seed)
        q, dq, ddq = _motion(rng, lower, upper, speed)
        models = self.loaded(mass_kg, center_m, inertia_kg_m2), self.model
        torques = [self.link_torque(model, q, dq, ddq) for model in models]
        size = np.sqrt(np.mean(torques[1] ** 2, axis=0))
        size = np.maximum(size, 0.05 * size.max())
        friction = _FRICTION_SHARE * size * (np.tanh(dq / 0.01) + dq)
        found = []
        for torque in torques:
            measured = np.tile(torque + friction, (PERIODS, 1))
            measured += _NOISE_SHARE * size * rng.normal(size=measured.shape)
            position = np.tile(q, (PERIODS, 1)) + 1e-5 * rng.normal(size=measured.shape)
            found.append(SimulatedRun(np.arange(len(measured)) / RATE_HZ, position, measured))
        return found


def _motion(rng, lower, upper, speed):
    """One period of a Fourier series: (N, n) positions, velocities, accelerations."""
    lower, upper = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    fast = np.where((speed > 0.0) & (speed < np.pi), speed, _FEW_RAD_S)
    w = 2.0 * np.pi * BASE_HZ * np.arange(1, HARMONICS + 1)
    t = np.arange(round(RATE_HZ / BASE_HZ))[:, None] / RATE_HZ
    a, b = rng.normal(size=(2, HARMONICS, len(lower))) / np.arange(1, HARMONICS + 1)[:, None]
    sine, cosine = np.sin(w * t), np.cos(w * t)
    q = sine @ a + cosine @ b
    dq = (cosine * w) @ a - (sine * w) @ b
    ddq = -(sine * w**2) @ a - (cosine * w**2) @ b
    scale = np.minimum(
        _RANGE_SHARE * 0.5 * (upper - lower) / np.abs(q).max(axis=0), _SPEED_SHARE * fast / np.abs(dq).max(axis=0)
    )
    return 0.5 * (lower + upper) + scale * q, scale * dq, scale * ddq
