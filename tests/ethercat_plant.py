"""er50's plant behind the drives of with-ethercat, in a process of its own, for a command in real time.

    python -m tests.ethercat_drives er50 .venv/bin/python -m tests.ethercat_plant LOAD COMMAND ...

LOAD is a payload of er50's simulation, or none. In the command, {robot} is the path of a file of er50 on this EtherCAT
line, with one period of each excitation, and a cycle and limits that a busy computer keeps.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

from armload_controller.config.robot import load_robot
from armload_controller.config.robot_simulation import NO_PAYLOAD
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation
from tests.ethercat_drives import er50_text
from tests.lockstep_line import PlantBehindDrives, plant_link


def shortened(robot, periods=1):
    """An arm with other numbers of periods."""
    excitations = {role: Excitation(found.trajectory, periods) for role, found in robot.excitations.items()}
    return replace(robot, excitations=excitations)


def write_robot(folder: Path, periods: int = 1, **changes: object) -> Path:
    """er50's file for the EtherCAT line, and its excitations; the path."""
    path = folder / "er50_ethercat.toml"
    for role, found in shortened(load_robot("er50"), periods).excitations.items():
        write_excitation(path.with_name(f"er50_{role}.toml"), found)
    path.write_text(er50_text(os.environ["WITH_ETHERCAT"], **changes))
    return path


def plant_behind(drives, payload, twin):
    """The plant of er50's simulation with a payload, behind drives with these settings."""
    loaded = payload != NO_PAYLOAD
    plant = ArmPlant(twin.plant_spec(payload if loaded else None, run=int(loaded)))
    return PlantBehindDrives(plant, drives, drives.cycle_s)


def _serve(path, payload, ready):
    """Answer until the drives end."""
    drives, twin = load_robot(str(path)).drives.settings, load_robot("er50").simulation
    link, plant = plant_link(), plant_behind(drives, payload, twin)
    link.reply(*plant(link.receive()))
    ready.set()
    link.serve(plant)


@contextmanager
def plant_process(path, payload):
    """The plant runs within the block."""
    processes = get_context("spawn")
    ready = processes.Event()
    process = processes.Process(target=_serve, args=(path, payload, ready), daemon=True)
    process.start()
    try:
        if not ready.wait(60.0):
            raise RuntimeError("the plant does not start")
        yield
    finally:
        process.terminate()
        process.join()


if __name__ == "__main__":
    payload, *command = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        path = write_robot(Path(folder), cycle_hz=100.0, max_missing_cycles=20)
        with plant_process(path, payload):
            sys.exit(subprocess.run([word.format(robot=path) for word in command], check=False).returncode)
