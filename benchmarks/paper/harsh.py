"""Limits of the accuracy on the harsh plant: its sources of error, added one by one."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.config.robot_simulation import HARSH_GAIN_ERROR
from armload_drivers.simulation.plant_spec import RigidBody
from benchmarks.arms.setups import Motion, Twin, setup_of
from benchmarks.arms.trials import Setup, run_trials
from benchmarks.results.error_statistics import Errors
from benchmarks.results.tally import progress_line

SEEDS = 40


def print_limits(pool: Executor, robot: Robot, motion: Motion, payload: RigidBody, name: str) -> None:
    """Median error of mass and centre of mass, source by source.

    Args:
        pool: Processes.
        robot: The arm.
        motion: Its motion.
        payload: The true payload in the flange frame.
        name: Name of the table.
    """

    def setup(twin: Twin) -> Setup:
        return setup_of(f"{name}, {twin}", robot, twin, motion, payload)

    gears, harsh = setup(Twin.GEARS).without_noise(), setup(Twin.HARSH)
    no_noise = harsh.without_noise()
    stages = (
        ("gear efficiency 0.85 and 0.75, elastic joints", gears, 1),
        ("+ friction 3 % higher in the second run", no_noise, 1),
        ("+ gains uniform within 2 %", no_noise.with_gains(HARSH_GAIN_ERROR), SEEDS),
        ("+ noise: all of harsh", harsh.with_gains(HARSH_GAIN_ERROR), SEEDS),
    )
    print(f"  {name}: what limits it, each with what stands above it  | mass error %  centre of mass off, mm")
    for what, stage, seeds in stages:
        with progress_line(what, seeds) as progress:
            errors = Errors.of(run_trials(pool, stage, seeds, progress), stage.truth)
        mass, center = (np.median(np.abs(x)) if x.size else np.nan for x in (errors.mass_share, errors.center_m))
        print(f"    {what:60s} | {100.0 * mass:12.2f} {1e3 * center:23.1f}")
