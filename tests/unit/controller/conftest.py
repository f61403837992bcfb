"""Recordings of er50 as from a commissioning, but with torques computed by Pinocchio."""

import contextlib
import json
import os

import numpy as np
import pinocchio as pin
import pytest

import armload
from armload_controller.analysis.robot_calibration import calibrate
from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.files.calibration_file import write_calibration
from armload_identification.model.payload import InertialParameters

PERIODS, RATE_HZ = 4, 50.0
"""Fewer rows than from a bus, each with the noise of a mean, so that tests are fast."""


@pytest.fixture(scope="session")
def recorded_er50(tmp_path_factory, in_pinocchio):
    """A folder with runs/today: four recordings of er50, and the payload that is identified from one pair."""
    folder = tmp_path_factory.mktemp("desk")
    today = folder / "runs" / "today"
    today.mkdir(parents=True)
    robot = load_robot("er50")
    spec = robot.simulation.plant_spec(None)
    links = [
        InertialParameters.from_center_of_mass(body.mass_kg, body.center_of_mass_m, body.inertia_kg_m2)
        for body in (joint.link for joint in spec.joints)
    ]
    payload = robot.simulation.payload("paper")
    rng = np.random.default_rng(4)
    for role, excitation in robot.excitations.items():
        for load in ("unloaded", "loaded"):
            model = in_pinocchio(robot.chain, links, payload if load == "loaded" else None)
            run = {"armload_version": "0", "robot": robot.name, "load": load, "role": role, "simulated": True}
            run |= {"created": "2026-03-01T10:00:00+00:00"}
            run |= {"mass_kg": payload.mass_kg} if load == "loaded" else {}
            attachments = {
                "configuration.toml": robot.text,
                "excitation.toml": format_excitation(excitation),
                "run.json": json.dumps(run),
            }
            with Recorder(today / f"{load}_{role}.mcap", attachments) as recorder:
                for values in _cycles(robot, model, excitation.trajectory, rng):
                    recorder.write(*values)
    runs = (today / f"{load}_identification.mcap" for load in ("loaded", "unloaded"))
    armload.identify(robot, *runs).save(today / "payload.toml")
    calibrated = calibrate(robot, sorted(today.glob("*_identification.mcap"))).calibration
    write_calibration(today / "arm.calibration.toml", calibrated)
    return folder


@pytest.fixture(scope="session")
def found(recorded_er50):
    """An identification with its validation."""
    with contextlib.chdir(recorded_er50):
        pairs = [
            [f"runs/today/{load}_{role}.mcap" for load in ("loaded", "unloaded")]
            for role in ("identification", "validation")
        ]
        return armload.identify("er50", *pairs[0], validation=tuple(pairs[1]))


@pytest.fixture
def recorded(recorded_er50, tmp_path):
    """Four complete recordings without results."""
    folder = tmp_path / "run"
    folder.mkdir()
    for path in (recorded_er50 / "runs" / "today").glob("*.mcap"):
        os.link(path, folder / path.name)
    return folder


def _cycles(robot, model, trajectory, rng):
    """Arguments of the recorder in each cycle of some periods."""
    data = model.createData()
    count = round(trajectory.period_s * RATE_HZ)
    state = trajectory.evaluate(np.arange(1, count + 1) / RATE_HZ)
    motion = zip(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2, strict=True)
    torque = np.array([pin.rnea(model, data, *joints) for joints in motion])
    torque += 4.0 * np.tanh(state.velocity_rad_s / 0.01) + 5.0 * state.velocity_rad_s
    noise_nm = robot.limits.torque_noise_nm * np.sqrt(RATE_HZ / robot.bus.cycle_hz)
    still, missing = np.zeros(robot.n), np.zeros(robot.n, dtype=bool)
    statusword = np.full(robot.n, 0x0637, dtype=np.uint16)
    for cycle in range(PERIODS * count):
        now = cycle % count
        noisy = torque[now] + noise_nm * rng.normal(size=robot.n)
        current = (noisy @ robot.drives.coupling) / robot.drives.transmission.gain_nm_a
        position = state.position_rad[now] + 2e-5 * rng.normal(size=robot.n)
        time_s = (cycle + 1) / RATE_HZ
        feedback = JointFeedback(cycle, time_s, position, None, current, None, statusword, missing)
        yield feedback, JointCommand(state.position_rad[now], still, still), Segment.PERIODS, time_s
