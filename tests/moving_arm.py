"""A short commissioning of the simulated prbt, without validation; a program, run on another processor.

Prints the mass found, and digests of the recorded positions, which are equal on all processors.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from armload_controller.config.robot import load_robot
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import CommissioningPlan, read_pair, record_half, recording_path
from armload_controller.session.run_session import SessionLoad, no_operator
from armload_identification.pipeline.payload_identification import identify, payload_result
from tests.short_commissioning import write_short_robot


def main() -> None:
    """Record an empty and a loaded run, and identify."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robot = load_robot(str(write_short_robot(folder)))
        for load in SessionLoad:
            recording_path(folder, load, "validation").touch()  # as if it had been recorded before
            record_half(
                robot, load, lambda which: simulated_arm(robot, which), no_operator(), CommissioningPlan(folder)
            )
        pair = read_pair(robot, folder, "identification")
        for run in (pair.unloaded, pair.loaded):
            print(hashlib.sha256(run.position_rad.tobytes()).hexdigest(), len(run.time_s))
        found = identify(pair.loaded, pair.unloaded, robot.chain, robot.drives.transmission)
        print(f"{payload_result(found, 'test', robot.sha256).model.mass_kg:.2f} kg")
    print(platform.machine(), file=sys.stderr)


if __name__ == "__main__":
    main()
