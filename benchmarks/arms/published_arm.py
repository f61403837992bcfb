"""An arm of a published URDF, simulated by Pinocchio: with other links than in its file, gears, drives, and motion.

It shares no dynamics with the code under test, and no number of it was chosen by what an identification makes of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pinocchio as pin
from scipy.signal import lfilter

import armload
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters
from armload_identification.recording.recording import Recording
from tests.urdf_simulation import PinocchioArm

RATE_HZ: Final = 125.0
LASTS_S: Final = 60.0
RANGE_SHARE: Final = 0.6
"""Of the joints' ranges, at most 2.5 rad to each side, in motion."""
LINKS: Final = 0.15
"""Greatest relative difference of a link's mass and inertia from the file's."""
CENTER_M: Final = 0.005
"""Standard deviation of a link's centre of mass about the file's."""
NOISE: Final = 0.006
"""Of the torque, relative to a joint's torque scale; a fifth of its variance has a memory."""
MEMORY_S: Final = 0.2
STEP: Final = 0.002
"""Of the reported torque, relative to that scale."""
RUN_FRICTION: Final = 0.007
"""Standard deviation of a joint's friction from run to run."""
ENCODER_RAD: Final = 1e-5


@dataclass(frozen=True)
class Motion:
    """From point to point, by polynomials of fifth order.

    Attributes:
        points_rad: (M + 1, n) points.
        begin_s: (M,) times at which the arm leaves each but the last.
        lasts_s: (M,) durations.
    """

    points_rad: FloatArray
    begin_s: FloatArray
    lasts_s: FloatArray

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(N, n) position, velocity and acceleration."""
        which = np.clip(np.searchsorted(self.begin_s, time_s, side="right") - 1, 0, None)
        lasts = self.lasts_s[which][:, None]
        x = np.clip((time_s - self.begin_s[which])[:, None] / lasts, 0.0, 1.0)
        way = self.points_rad[which + 1] - self.points_rad[which]
        position = self.points_rad[which] + way * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        velocity = way * 30.0 * x**2 * (1.0 - x) ** 2 / lasts
        return position, velocity, way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / lasts**2


class PublishedArm:
    """One specimen.

    Args:
        path: URDF.
        base: Link of the base; None for the file's.
        flange: Link of the flange; None for the file's.
        rng: Draws the specimen.

    Attributes:
        urdf: The arm by its file.
    """

    def __init__(self, path: Path, base: str | None, flange: str | None, rng: np.random.Generator) -> None:
        self.urdf = armload.read_urdf_arm(path, base=base, flange=flange)
        self._rng, n = rng, self.urdf.n
        self._pinocchio = PinocchioArm(path, self.urdf.joint_names, self.urdf.base, self.urdf.flange)
        model = self._pinocchio.model
        for joint in range(1, model.njoints):
            link, times = model.inertias[joint], rng.uniform(1.0 - LINKS, 1.0 + LINKS)
            center = link.lever + CENTER_M * rng.normal(size=3)
            model.inertias[joint] = pin.Inertia(link.mass * times, center, link.inertia * times)
        joints = [model.joints[model.getJointId(name)] for name in self.urdf.joint_names]
        speed = model.velocityLimit[self._pinocchio.places]
        self._speed_rad_s = np.where(speed > 0.0, np.minimum(speed, 3.0), 1.5)
        low, high = (
            np.array([limit[joint.idx_q] if joint.nq == 1 else np.inf for joint in joints])
            for limit in (model.lowerPositionLimit, model.upperPositionLimit)
        )
        low, high = (
            np.clip(np.where(np.isfinite(limit), limit, end), -2.5, 2.5) for limit, end in ((low, -2.5), (high, 2.5))
        )
        self._middle_rad, self._reach_rad = 0.5 * (low + high), 0.5 * RANGE_SHARE * (high - low)
        poses = self._middle_rad + self._reach_rad * rng.uniform(-1.0, 1.0, (200, n))
        weight = np.abs(self._link_torque(None, poses, 0.0 * poses, 0.0 * poses)).max(axis=0)
        self._scale_nm = np.maximum(weight, 0.12 * weight.max()) + 1.0
        self._coulomb_nm = self._scale_nm * rng.uniform(0.05, 0.15, n)
        self._viscous_nm_s_rad = self._scale_nm * rng.uniform(0.03, 0.1, n) / self._speed_rad_s
        self._load_friction = rng.uniform(0.02, 0.1, n)
        self._rotor_kg_m2 = self._scale_nm * rng.uniform(0.007, 0.02, n)
        self._delay_s = rng.uniform(0.0, 0.003)

    def motion(self) -> Motion:
        """A motion from point to point, at up to half the greatest speeds, with short stops."""
        points, begin, lasts, now_s = [self._point()], [], [], 0.5
        while now_s < LASTS_S:
            points.append(self._point())
            lasts.append(max(1.0, float((1.875 * np.abs(points[-1] - points[-2]) / (0.5 * self._speed_rad_s)).max())))
            begin.append(now_s)
            now_s += lasts[-1] + self._rng.uniform(0.2, 0.8)
        return Motion(np.array(points), np.array(begin), np.array(lasts))

    def run(
        self, motion: Motion, payload: InertialParameters | None, gain: FloatArray, friction: float = 1.0
    ) -> Recording:
        """A recording of the reported torque.

        Args:
            payload: What the flange carries.
            gain: (n,) reported over true torque.
            friction: Factor on the day's friction.
        """
        rng, time_s = self._rng, np.arange(round(LASTS_S * RATE_HZ)) / RATE_HZ
        q, dq, ddq = motion.at(time_s - self._delay_s)
        links = self._link_torque(payload, q, dq, ddq)
        today = friction * (1.0 + RUN_FRICTION * rng.normal(size=self.urdf.n))
        direction = np.tanh(dq / (0.003 * self._speed_rad_s))
        gears = direction * (today * self._coulomb_nm + self._load_friction * np.abs(links))
        torque = links + self._rotor_kg_m2 * ddq + gears + today * self._viscous_nm_s_rad * dq
        fades = np.exp(-1.0 / (RATE_HZ * MEMORY_S))
        slow = lfilter([np.sqrt(1.0 - fades**2)], [1.0, -fades], rng.normal(size=(len(q) + 300, self.urdf.n)), axis=0)
        noise = np.sqrt(0.8) * rng.normal(size=q.shape) + np.sqrt(0.2) * slow[300:]
        reported = gain * (torque + NOISE * self._scale_nm * noise)
        step = STEP * self._scale_nm
        position = motion.at(time_s)[0] + ENCODER_RAD * rng.normal(size=q.shape)
        return Recording.from_arrays(time_s, position, torque_nm=step * np.round(reported / step), name="run")

    def _point(self) -> FloatArray:
        """(n,) a random pose."""
        return np.asarray(self._middle_rad + self._reach_rad * self._rng.uniform(-1.0, 1.0, self.urdf.n))

    def _link_torque(
        self, payload: InertialParameters | None, q: FloatArray, dq: FloatArray, ddq: FloatArray
    ) -> FloatArray:
        """(N, n) torque of links and payload, by Pinocchio."""
        model = self._pinocchio.model
        if payload is not None:
            model = self._pinocchio.loaded(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
        return self._pinocchio.link_torque(model, q, dq, ddq)
