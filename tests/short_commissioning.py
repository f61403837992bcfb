"""prbt with excitations of a few seconds or less, for tests of a complete commissioning."""

import re
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.session.commissioning import ROLES, CommissioningPlan, record_half, recording_path
from armload_controller.session.run_session import no_operator
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory

MIDDLE_RAD = np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0])
RECORDINGS = {recording_path(Path(), load, role).name for load in SessionLoad for role in ROLES}


def least_robot():
    """prbt with excitations of half a second, too short to identify from."""
    swing = np.full((6, 1), 0.008)
    excitations = {
        role: Excitation(FourierTrajectory(2.0, MIDDLE_RAD, swing, 0.5 * sign * swing), 1)
        for role, sign in zip(ROLES, (1.0, -1.0), strict=True)
    }
    return replace(load_robot("prbt"), excitations=excitations)


def record(robot, folder, make_servos, loads=tuple(SessionLoad)):
    """Record the runs of a commissioning that are still missing.

    Args:
        robot: The arm.
        folder: Where the recordings go.
        make_servos: Makes the servos of a half.
        loads: The halves.
    """

    @contextmanager
    def open_servos(load):
        yield make_servos()

    for load in loads:
        record_half(robot, load, open_servos, no_operator(), CommissioningPlan(folder))


def write_short_robot(folder, frequency_hz=0.5, swing_rad=0.15, cycle_hz=50):
    """Write prbt's file with two periods of one harmonic, which hardly determine a centre of mass; returns its path."""
    text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
    for role, sign in zip(ROLES, (1.0, -1.0), strict=True):
        turned = 0.5 * sign * np.arange(6)[:, None]
        trajectory = FourierTrajectory(frequency_hz, MIDDLE_RAD, swing_rad * np.cos(turned), swing_rad * np.sin(turned))
        write_excitation(folder / f"{role}.toml", Excitation(trajectory, 2))
        text, count = re.subn(rf'^{role} = ".*"$', f'{role} = "{role}.toml"', text, flags=re.MULTILINE)
        assert count == 1
    text = text.replace("cycle_hz = 100", f"cycle_hz = {cycle_hz}")
    path = folder / "short.toml"
    path.write_text(text)
    return path
