"""An excitation of the UR10e by armload and by FIGAROH with IPOPT, with the same limits, 10 s, one start each.

Both minimise the condition number of the payload's ten columns in SI units, FIGAROH in the last joint's frame and
armload at the flange; Pinocchio judges both motions in both frames. The limits are of position, speed and torque;
FIGAROH has no limit of acceleration, armload keeps 10 rad/s2. CPU time is the program's, start-up included.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from armload_controller.config.robot import load_robot
from armload_identification.float_array import FloatArray
from benchmarks.accuracy.real_currents import FOLDER
from benchmarks.peers.peer_environment import PEERS_PYTHON
from benchmarks.peers.peer_programs import answer_of, lines_of, without_meshes

SEEDS: Final = (1, 2)
ARM_SHARE: Final = 0.5
PAYLOAD: Final = """
[expected_payload]
mass_kg = 2.805
center_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { ixx = 0.02, iyy = 0.02, izz = 0.02, ixy = 0.0, ixz = 0.0, iyz = 0.0 }
"""
"""Added to the shipped file, which is for recordings only; a design needs a payload."""


def run() -> None:
    """Print the table, or why it cannot be measured here."""
    if not FOLDER.is_dir():
        print(f"not measured: the URDF of the UR10e is not at {FOLDER}")
        return
    table = Table(title="an excitation of the UR10e for a payload, 10 s, one start each, two seeds")
    for column in ("", "cond, flange", "cond, last joint", "greatest rad/s2", "CPU s", "lines"):
        table.add_column(column, justify="left" if not column else "right")
    with tempfile.TemporaryDirectory() as folder:
        robot, urdf = Path(folder) / "ur10e.toml", Path(folder) / "ur10e.urdf"
        robot.write_text(_complete(), "utf-8")
        urdf.write_text(_limited(without_meshes(FOLDER / "ur10e.urdf")), "utf-8")
        model = pin.buildModelFromUrdf(str(urdf))
        for name, python, program, file in (
            ("armload", Path(sys.executable), "excitation_by_armload.py", robot),
            ("FIGAROH 1.0.2, IPOPT", PEERS_PYTHON, "excitation_by_figaroh.py", urdf),
        ):
            answers = [answer_of(python, program, [str(file), str(seed)]) for seed in SEEDS]
            motions = [[np.array(json.loads(text)[key]) for key in ("P_F", "V_F", "A_F")] for text, _ in answers]
            conditions = np.array([_conditions(model, *motion) for motion in motions])
            table.add_row(
                name,
                *(", ".join(f"{value:.2f}" for value in column) for column in conditions.T),
                ", ".join(f"{np.abs(motion[2]).max():.1f}" for motion in motions),
                ", ".join(f"{cpu_s:.1f}" for _, cpu_s in answers),
                str(lines_of(program)),
            )
    Console(width=120).print(table)


def _complete() -> str:
    """The shipped robot with a payload and, as a design also needs it, half of every joint's torque for the arm."""
    text = resources.files("armload_configs").joinpath("ur10e.toml").read_text("utf-8")
    joints = text.replace("[[joints]]", f"[[joints]]\narm_torque_share = {ARM_SHARE}")
    return joints + PAYLOAD + PAYLOAD.replace("expected", "heaviest")


def _limited(urdf: str) -> str:
    """The URDF with the robot's limits of position, speed and torque."""
    limits, torque_nm = load_robot("ur10e").limits.motion, load_robot("ur10e").limits.torque_max_nm
    low, high, speed = limits.position_min_rad, limits.position_max_rad, limits.velocity_max_rad_s
    rows = iter(zip(low, high, speed, torque_nm, strict=True))

    def limit(_: re.Match[str]) -> str:
        lower, upper, velocity, effort = next(rows)
        return f'<limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="{effort}"/>'

    return re.sub(r"<limit\b[^>]*/>", limit, urdf)


def _conditions(model: pin.Model, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> tuple[float, float]:
    """Condition numbers of the payload's columns: at the flange, and in the last joint's frame."""
    data = model.createData()
    columns = np.vstack(
        [pin.computeJointTorqueRegressor(model, data, *state)[:, -10:] for state in zip(q, dq, ddq, strict=True)]
    )
    placement = model.frames[model.getFrameId("tool0")].placement
    # a body's parameters change linearly with their frame: from ten bodies, the linear map
    bodies = [pin.Inertia.Random() for _ in range(10)]
    there = np.column_stack([placement.act(body).toDynamicParameters() for body in bodies])
    here = np.column_stack([body.toDynamicParameters() for body in bodies])
    return float(np.linalg.cond(columns @ there @ np.linalg.inv(here))), float(np.linalg.cond(columns))
