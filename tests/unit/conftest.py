"""An arm whose torque Pinocchio computes, and recordings of it: the true values for tests of the identification."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters, PayloadResult, Provenance
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.signals.joint_torque import Transmission

XYZ_M = [(0.0, 0.0, 0.18), (0.0, 0.17, 0.0), (0.0, -0.13, 0.6), (0.0, 0.0, 0.57), (0.0, 0.13, 0.0), (0.0, 0.0, 0.12)]
RPY_RAD = [(0.0, 0.0, 0.0), (0.0, 1.2, 0.0), (0.0, 0.1, 0.0), (0.0, 1.5, 0.2), (0.0, 0.0, 0.0), (0.0, 0.0, -0.3)]
AXIS = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 0, 1), (0, 1, 0)]
FLANGE = ((0.0, 0.11, 0.0), (-1.57, 0.0, 0.0))
GRAVITY_M_S2 = (0.0, 0.0, -9.81)
LINK_KG = (8.0, 12.0, 6.0, 2.0, 2.0, 0.5)


class PinocchioArm:
    """Six joints with friction and coupled wrist motors; all random numbers come from the seed of a run."""

    n = 6
    chain = Chain.from_origins(XYZ_M, RPY_RAD, AXIS, pose_from_xyz_rpy(*FLANGE), GRAVITY_M_S2)
    payload = InertialParameters.from_center_of_mass(
        4.2, [0.03, -0.12, 0.09], [[0.05, 0.004, -0.002], [0.004, 0.03, 0.003], [-0.002, 0.003, 0.04]]
    )
    transmission = Transmission(
        np.array([12.0, 12.0, 10.0, 8.0, 8.0, 7.0]),
        np.eye(6) + np.array([[0.0] * 6] * 4 + [[0, 0, 0, 0.02, 0, 0], [0, 0, 0, -0.02, 0.02, 0]]),
    )
    noise_nm = np.array([1.5, 1.2, 0.8, 0.3, 0.3, 0.2])

    def trajectory(self, seed: int = 3, period_s: float = 5.0, harmonics: int = 4) -> FourierTrajectory:
        rng = np.random.default_rng(seed)
        size = 0.45 / np.arange(1, harmonics + 1)
        return FourierTrajectory(
            1.0 / period_s,
            rng.uniform(-0.4, 0.4, self.n),
            rng.normal(size=(self.n, harmonics)) * size,
            rng.normal(size=(self.n, harmonics)) * size,
        )

    def torque(self, q, dq, ddq, payload=None, load_friction=0.0):
        """(N, n) joint torque by Pinocchio's recursive Newton-Euler, plus friction."""
        model = self._model(payload)
        data = model.createData()
        links = np.array([pin.rnea(model, data, *state) for state in zip(q, dq, ddq, strict=True)])
        along = np.tanh(dq / 0.01)
        return links + along * (4.0 + load_friction * np.abs(links)) + 5.0 * dq

    def run(
        self,
        trajectory: FourierTrajectory,
        loaded: bool,
        *,
        seed: int,
        periods: int = 3,
        cycle_s: float = 0.01,
        noise: float = 1.0,
        load_friction: float = 0.0,
        with_phase: bool = True,
        rate: float = 1.0,
    ) -> Recording:
        """Record complete periods; the arm follows exactly, and `rate` seconds pass per second of phase."""
        rng = np.random.default_rng(seed)
        cycles = round(trajectory.period_s / cycle_s)
        phase = np.arange(1, periods * cycles + 1) * cycle_s
        one = trajectory.evaluate(phase[:cycles])
        motion = (one.position_rad, one.velocity_rad_s / rate, one.acceleration_rad_s2 / rate**2)
        torque = self.torque(*motion, self.payload if loaded else None, load_friction)
        torque = np.tile(torque, (periods, 1)) + noise * self.noise_nm * rng.normal(size=(phase.size, self.n))
        position = np.tile(one.position_rad, (periods, 1)) + 2e-5 * rng.normal(size=torque.shape)
        current = (torque @ self.transmission.coupling) / self.transmission.gain_nm_a
        return Recording(
            time_s=100.0 + rate * phase,
            position_rad=position,
            velocity_rad_s=None,
            current_a=current,
            torque_nm=None,
            phase_s=phase if with_phase else None,
            excitation=Excitation(trajectory, periods) if with_phase else None,
            source=source(current, "loaded" if loaded else "unloaded"),
        )

    def _model(self, payload):
        model = pin.Model()
        model.gravity.linear = np.array(GRAVITY_M_S2)
        parent = 0
        for i in range(self.n):
            placement = pin.SE3(pin.rpy.rpyToMatrix(*map(float, RPY_RAD[i])), np.array(XYZ_M[i]))
            joint = pin.JointModelRevoluteUnaligned(np.array(AXIS[i], dtype=float))
            parent = model.addJoint(parent, joint, placement, f"joint{i + 1}")
            body = pin.Inertia(LINK_KG[i], np.array([0.01, 0.02, 0.15]), 0.02 * LINK_KG[i] * np.eye(3))
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        if payload is not None:
            flange = pin.SE3(pin.rpy.rpyToMatrix(*map(float, FLANGE[1])), np.array(FLANGE[0]))
            body = pin.Inertia(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
            model.appendBodyToJoint(parent, body, flange)
        return model


def pinocchio_model(
    chain: Chain, links: Sequence[InertialParameters], payload: InertialParameters | None = None
) -> pin.Model:
    """A chain in Pinocchio with links in its joint frames and a payload at its flange."""
    model = pin.Model()
    model.gravity.linear = chain.gravity_m_s2
    parent = 0
    for i, link in enumerate(links):
        placement = pin.SE3(chain.placement[i][:3, :3], chain.placement[i][:3, 3])
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(chain.axis[i]), placement, f"joint{i + 1}")
        body = pin.Inertia(link.mass_kg, link.center_of_mass_m, link.inertia_about_com)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    flange = pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3])
    model.addFrame(pin.Frame("flange", parent, 0, flange, pin.FrameType.OP_FRAME))
    if payload is not None:
        body = pin.Inertia(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
        model.appendBodyToJoint(parent, body, flange)
    return model


def random_arm(rng: np.random.Generator, n: int) -> tuple[Chain, tuple[InertialParameters, ...]]:
    """A random arm: axes, gravity and links in arbitrary directions."""
    chain = Chain.from_origins(
        rng.uniform(-0.5, 0.5, (n, 3)),
        rng.uniform(-np.pi, np.pi, (n, 3)),
        rng.normal(size=(n, 3)),
        pose_from_xyz_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-np.pi, np.pi, 3)),
        rng.uniform(-10.0, 10.0, 3),
    )
    return chain, tuple(random_body(rng) for _ in range(n))


def random_body(rng: np.random.Generator) -> InertialParameters:
    """A physically possible body: eight point masses."""
    points = 0.2 * (rng.normal(size=(8, 3)) + rng.normal(size=3))
    homogeneous = np.column_stack([points, np.ones(8)]) * np.sqrt(rng.uniform(0.1, 2.0, (8, 1)))
    return InertialParameters.from_pseudo_inertia(homogeneous.T @ homogeneous)


def source(data: np.ndarray, name: str) -> RecordingSource:
    """The source that a recording file would have."""
    return RecordingSource(
        path=Path(f"{name}.mcap"),
        sha256=hashlib.sha256(data.tobytes()).hexdigest(),
        kind="mcap",
        rows_read=len(data),
        reasons={},
    )


@pytest.fixture(scope="session")
def pinocchio_arm() -> PinocchioArm:
    return PinocchioArm()


@pytest.fixture(scope="session")
def pair(pinocchio_arm):
    """A loaded and an unloaded run of three periods."""
    trajectory = pinocchio_arm.trajectory()
    return (
        pinocchio_arm.run(trajectory, True, seed=11),
        pinocchio_arm.run(trajectory, False, seed=12),
    )


@pytest.fixture(scope="session")
def calibration(pinocchio_arm):
    """Pinocchio's arm, calibrated with an empty run and one with a payload of known mass; a third file was left out."""
    # imported here, so that other tests do not load the calibration
    from armload_identification.calibration.calibrate_arm import calibrate_arm
    from armload_identification.calibration.mounted_runs import ArmRuns, MountedRun, WeighedPayload

    trajectory = pinocchio_arm.trajectory(3, period_s=10.0)
    runs = tuple(
        MountedRun(pinocchio_arm.run(trajectory, load, seed=5 + load, with_phase=False), "disc" if load else "")
        for load in (False, True)
    )
    weighed = {"disc": WeighedPayload(pinocchio_arm.payload.mass_kg)}
    given = ArmRuns(runs, weighed, (("lost.csv", 'it is "gone"'),))
    made = Provenance("1.2.3", "c" * 64, {})
    return calibrate_arm(given, pinocchio_arm.chain, pinocchio_arm.transmission, robot="six", made=made)


@pytest.fixture
def chosen(calibration):
    """A calibration with gains 2 % above nominal, known to 1 % (one standard deviation)."""
    from armload_identification.recording.reading_options import Effort

    return replace(
        calibration,
        effort=Effort.CURRENT,
        nominal=np.full(6, 10.0),
        gain_nm_a=np.full(6, 10.2),
        noise_nm=np.full(6, 0.5),
        level_nm=np.full(6, 50.0),
        body=replace(calibration.body, load_friction=np.full(6, 0.03), torque_delay_s=0.002),
        covariance=0.01**2 * np.eye(len(calibration.covariance)),
        tilt_rad=np.radians([3.0, 4.0]),
    )


@pytest.fixture(scope="session")
def make_subject():
    """Subjects of an export: a shipped arm or a chain, with a payload whose products of inertia are all nonzero."""
    # imported here, so that the tests of the identification do not load the controller
    from armload_controller.config.robot import load_robot
    from armload_controller.export.exported_payload import ExportSubject
    from armload_controller.motion.joint_limits import MotionLimits

    def make_subject(robot: str = "er50", undetermined: tuple[str, ...] = (), **changes: object) -> ExportSubject:
        arm = load_robot(robot)
        body = InertialParameters.from_center_of_mass(
            2.7, [0.031, -0.012, 0.094], [[0.031, 0.004, -0.002], [0.004, 0.022, 0.003], [-0.002, 0.003, 0.017]]
        )
        known = np.array([name not in undetermined for name in PARAMETER_NAMES])
        interval = np.where(known[:, None], body.values[:, None] + np.array([-1e-4, 1e-4]), np.nan)
        per_joint = np.ones(arm.n)
        payload = PayloadResult(
            "flange", body, known, interval, per_joint, per_joint, Provenance("0", arm.sha256, {"a.csv": "0"})
        )
        subject = replace(ExportSubject.of(arm, payload, "payload.toml", "0123abcd"), armload_version="1.2.3")
        if isinstance(chain := changes.get("chain"), Chain):
            changes |= other_joints(chain.n) | {"payload": replace(payload, residual_rms_nm=np.ones(chain.n))}
        return replace(subject, **changes)

    def other_joints(n: int) -> dict[str, object]:
        two = np.full(n, 2.0)
        names = tuple(f"joint {i}" for i in range(n))
        return {"limits": MotionLimits(names, -two, two, two, two, two, two), "torque_max_nm": 50.0 * two}

    return make_subject


@pytest.fixture(scope="session")
def in_pinocchio() -> Callable[..., pin.Model]:
    return pinocchio_model


@pytest.fixture(scope="session")
def any_arm() -> Callable[[np.random.Generator, int], tuple[Chain, tuple[InertialParameters, ...]]]:
    return random_arm


@pytest.fixture(scope="session")
def any_body() -> Callable[[np.random.Generator], InertialParameters]:
    return random_body


@pytest.fixture
def edited(tmp_path):
    """A copy of a shipped configuration with some text replaced; returns its path."""

    configs = Path(str(resources.files("armload_configs")))

    def edited(old, new, robot="er50", count=1):
        text = (configs / f"{robot}.toml").read_text()
        assert old in text
        path = tmp_path / f"my_{robot}.toml"
        path.write_text(text.replace(old, new, count))
        for file in configs.glob(f"{robot}_*.toml"):
            (tmp_path / file.name).write_text(file.read_text())
        return str(path)

    return edited
