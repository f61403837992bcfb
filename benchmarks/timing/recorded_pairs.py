"""A simulated pair of runs, recorded in several formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin

from armload_controller.config.chain_from_urdf import read_urdf_arm
from benchmarks.hostile_files import write_bag, write_first_bag
from tests.foreign_tables import ARMS, DIALECTS, Run, urdf_of
from tests.urdf_simulation import PinocchioArm


def recorded_pairs(folder: Path) -> dict[str, tuple[str, str, str]]:
    """Paths of a URDF, a loaded and an empty run of 20 s, by the format of the runs."""
    joints, urdf = ARMS["UR"], folder / "arm.urdf"
    urdf.write_text(urdf_of(joints))
    arm = read_urdf_arm(urdf)
    limits = arm.position_min_rad, arm.position_max_rad, arm.velocity_max_rad_s
    simulated = PinocchioArm(urdf, joints, arm.base, arm.flange)
    pair = simulated.runs(*limits, 1.5, (0.02, -0.01, 0.06), 0.002 * np.eye(3))
    files: dict[str, list[Path]] = {}
    for load, made in zip(("loaded", "unloaded"), pair, strict=True):
        velocity = np.gradient(made.position_rad, made.time_s, axis=0)
        one = Run(made.time_s, made.position_rad, velocity, made.torque_nm, joints)
        arrays = folder / f"{load}.npz"
        np.savez(arrays, time_s=one.time_s, position_rad=one.position_rad, torque_nm=one.torque_nm)
        written = {
            "NumPy archives": arrays,
            "CSV": DIALECTS["plotjuggler"](one, folder / f"{load}.csv"),
            "ROS 2 bags, MCAP": write_bag(folder / f"{load}_mcap", StoragePlugin.MCAP, run=one),
            "ROS 2 bags, SQLite": write_bag(folder / f"{load}_db3", StoragePlugin.SQLITE3, run=one),
            "ROS 1 bags": write_first_bag(folder / f"{load}.bag", one),
        }
        for name, path in written.items():
            files.setdefault(name, []).append(path)
    return {name: (str(urdf), str(loaded), str(unloaded)) for name, (loaded, unloaded) in files.items()}
