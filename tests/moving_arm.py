"""A commissioning of a simulated arm; a program, run on another processor.

Without an argument, a short one of prbt without validation; with a robot's name, all four runs of its own excitations.
Prints the masses found, and digests of the recorded positions, which are equal on all processors.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from armload_controller.config.robot import load_robot
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import ROLES, CommissioningPlan, read_pair, record_half, recording_path
from armload_controller.session.run_session import no_operator
from armload_controller.session.session_load import SessionLoad
from armload_identification.model.payload import Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from tests.short_commissioning import write_short_robot


def main(name: str | None = None) -> None:
    """Record the runs, and identify from each pair."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        robot = load_robot(str(write_short_robot(folder, 1.0, 0.05, 25)) if name is None else name)
        roles = ROLES[:1] if name is None else ROLES
        for load in SessionLoad:
            for role in ROLES[len(roles) :]:
                recording_path(folder, load, role).touch()  # as if it had been recorded before
            record_half(
                robot, load, lambda which: simulated_arm(robot, which), no_operator(), CommissioningPlan(folder)
            )
        for role in roles:
            loaded, unloaded = read_pair(robot, folder, role)
            for run in (unloaded, loaded):
                print(hashlib.sha256(run.position_rad.tobytes()).hexdigest(), len(run.time_s))
            found = identify_runs(loaded, unloaded, robot.chain, robot.drives.transmission)
            print(f"{payload_result(found, Provenance('test', robot.sha256, {})).model.mass_kg:.2f} kg")
    print(f"{platform.machine()}: {time.process_time():.0f} s of CPU", file=sys.stderr)


if __name__ == "__main__":
    main(*sys.argv[1:])
