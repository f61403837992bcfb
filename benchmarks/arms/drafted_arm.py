"""An arm as `armload init` drafts it from a URDF, with its simulated twin: of the size of a 10 kg collaborative arm.

All numbers of the URDF are round and our own. `init` designs both excitations, which takes half a minute.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from armload_controller.config.robot import Robot, load_robot

PAYLOAD_KG = 3.0
_JOINTS = (
    # origin in the previous link (m), axis, greatest speed (rad/s), effort (N m), mass (kg), centre of mass (m)
    ((0.0, 0.0, 0.18), "0 0 1", 2.0, 330.0, 8.0, (0.0, 0.0, 0.0)),
    ((0.0, 0.17, 0.0), "0 1 0", 2.0, 330.0, 13.0, (0.0, 0.0, 0.3)),
    ((0.0, -0.13, 0.6), "0 1 0", 3.0, 150.0, 4.0, (0.0, 0.0, 0.28)),
    ((0.0, 0.0, 0.57), "0 1 0", 3.0, 54.0, 2.0, (0.0, 0.13, 0.0)),
    ((0.0, 0.13, 0.0), "0 0 1", 3.0, 54.0, 2.0, (0.0, 0.0, 0.12)),
    ((0.0, 0.0, 0.12), "0 1 0", 3.0, 54.0, 0.3, (0.0, 0.08, 0.0)),
)
_RANGE_RAD = 3.1
_GYRATION_M = 0.1


def drafted_arm() -> Robot:
    """The robot, drafted anew in a temporary folder.

    Raises:
        CalledProcessError: `armload init` failed.
    """
    with tempfile.TemporaryDirectory() as directory:
        urdf, robot = Path(directory) / "drafted.urdf", Path(directory) / "drafted.toml"
        urdf.write_text(drafted_urdf(), encoding="utf-8")
        options = ["--payload-kg", str(PAYLOAD_KG), "--simulated", "--restarts", "2", "--output", str(robot)]
        program = Path(sys.executable).with_name("armload")
        subprocess.run([program, "init", str(urdf), *options], check=True, capture_output=True)
        arm = load_robot(str(robot))
        _ = arm.obstacles  # are read from the URDF while it is there
        return arm


def drafted_urdf() -> str:
    """The description of the arm."""
    parts = ['<link name="link_0"/>']
    for number, (origin, axis, speed, effort, mass, center) in enumerate(_JOINTS, start=1):
        inertia = mass * _GYRATION_M**2
        parts.append(
            f'<joint name="joint_{number}" type="revolute"><parent link="link_{number - 1}"/><child '
            f'link="link_{number}"/><origin xyz="{_text(origin)}"/><axis xyz="{axis}"/>'
            f'<limit lower="{-_RANGE_RAD}" upper="{_RANGE_RAD}" velocity="{speed}" effort="{effort}"/></joint>'
            f'<link name="link_{number}"><inertial><origin xyz="{_text(center)}"/><mass value="{mass}"/>'
            f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    return f'<robot name="drafted">{"".join(parts)}</robot>'


def _text(values: tuple[float, ...]) -> str:
    return " ".join(str(value) for value in values)
