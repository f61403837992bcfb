"""The picture of WATCH.md, from a simulated er50 that another CANopen master drives: `make pictures`.

The arm is recorded empty and with a weighed payload, calibrated from these runs, and then watched: a payload is mounted
and removed while it moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from armload_controller.analysis.payload_watch import PayloadWatch, WatchedMoment
from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.analysis.watch_history import WatchDiary
from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.robot_runs import read_runs
from armload_controller.session.bus_watch import BusWatch, recorder_of
from armload_controller.session.session_load import SessionLoad
from armload_drivers.listening.overheard_arm import OverheardArm, OverheardCycle
from armload_drivers.simulation.plant_spec import ScheduledPayload
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.files.calibration_file import write_calibration
from armload_identification.report.watch_report import watch_svg
from benchmarks.canopen_runs.canopen_master import arm_under_canopen

PICTURE = Path(__file__).parents[2] / "controller" / "pictures" / "watch.svg"
ROBOT, CYCLE_HZ, CALIBRATED_S, WATCHED_S = "er50", 50.0, 60.0, 90.0
MOUNTED_S, DROPPED_S = 30.0, 62.0
SPEED_SHARE, RANGE_RAD, PAUSE_S = (0.2, 0.6), 1.2, 0.2


def draw(folder: Path) -> None:
    """Watch a shift and draw it.

    Args:
        folder: Temporary, for recordings and calibration.
    """
    robot = load_robot(ROBOT).with_bus(None, None, None, CYCLE_HZ)
    calibration = _calibration(robot, folder)
    body = robot.simulation.mounted(robot.simulation.payload_name)
    changes = (ScheduledPayload(MOUNTED_S, body), ScheduledPayload(DROPPED_S, None))
    cycles = overheard_shift(robot, None, 7, WATCHED_S, changes)
    watching = PayloadWatch(robot, calibration)
    diary = WatchDiary(robot, watching, "a simulated bus")
    for moment in moments_of(BusWatch(robot, watching, None), cycles):
        diary.add(moment)
    title = (
        "er50 under another master: 9.8 kg are mounted after 30 s and taken off after 62 s; mass with its 95 % interval"
    )
    svg = watch_svg(diary.history(), "watch", title)
    PICTURE.parent.mkdir(exist_ok=True)
    PICTURE.write_text(svg.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1) + "\n")
    print(f"{PICTURE}: {PICTURE.stat().st_size} bytes")


def _calibration(robot: Robot, folder: Path) -> Path:
    """Calibration of the arm from its bus traffic."""
    paths = []
    for seed, (load, payload) in enumerate(
        ((SessionLoad.UNLOADED, None), (SessionLoad.LOADED, robot.simulation.payload_name)), 1
    ):
        cycles = overheard_shift(robot, payload, seed, CALIBRATED_S)
        paths.append(folder / f"{load}.mcap")
        with recorder_of(robot, paths[-1], load) as recorder:
            list(moments_of(BusWatch(robot, None, recorder), cycles))
    runs = read_runs(robot, paths)
    mass_kg = robot.simulation.payload(robot.simulation.payload_name).mass_kg
    weighed = {run.mounting: WeighedPayload(mass_kg) for run in runs.runs if run.mounting}
    write_calibration(folder / "arm.calibration.toml", calibrate_from_runs(robot, replace(runs, weighed=weighed)))
    return folder / "arm.calibration.toml"


def overheard_shift(
    robot: Robot, payload: str | None, seed: int, until_s: float, changes: Sequence[ScheduledPayload] = ()
) -> list[OverheardCycle]:
    """Bus traffic of an arm in random point-to-point motion.

    Args:
        robot: The arm.
        payload: Name of the payload at the start; None for none.
        seed: Of poses, speeds and noise.
        until_s: End of the last move, at the earliest.
        changes: Payloads mounted and removed later.
    """
    listener = OverheardArm(robot.drives.settings)
    cycles: list[OverheardCycle] = []
    limits, rng = robot.limits.motion, np.random.default_rng(seed)
    low, high = np.maximum(limits.position_min_rad, -RANGE_RAD), np.minimum(limits.position_max_rad, RANGE_RAD)
    now_s = 0.0

    def hear(cob_id: int, data: bytes, time_s: float) -> None:
        nonlocal now_s
        now_s = time_s
        cycle = listener.take(cob_id, data, time_s)
        if cycle is not None:
            cycles.append(cycle)

    spec = robot.simulation.plant_spec(payload, seed, changes)
    with arm_under_canopen(robot.drives.settings, spec, hear) as master:
        here = master.enable()
        while now_s < until_s:
            there = rng.uniform(low, high)
            master.go(here, there, rng.uniform(*SPEED_SHARE) * limits.velocity_max_rad_s)
            master.stay(there, PAUSE_S)
            here = there
        master.switch_off(here)
    return cycles


def moments_of(watching: BusWatch, cycles: Sequence[OverheardCycle]) -> Iterator[WatchedMoment]:
    """What a watch reports on cycles overheard before."""
    left = count(-len(cycles))
    return watching.moments(iter(cycles), lambda: next(left) < 0)
