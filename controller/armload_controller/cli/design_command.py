"""`armload design`: the excitation that tells most about a payload within all limits."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from importlib.metadata import version
from math import ceil, floor, inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import RobotArgument

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from armload_controller.config.robot import Robot
    from armload_identification.excitation.design import DesignResult
    from armload_identification.excitation.design_search import PeriodRange

POSITION_MARGIN_RAD = 0.1
"""Room left to the position limits, for the ramps and the servo."""
RATE_SHARE = 0.7
"""Share of speed, acceleration and jerk limits that the excitation uses; the phase ramps need the rest."""
TORQUE_SHARE = 0.8
"""Share of the torque limits that arm and heaviest payload use; ramps, and what no model knows, have the rest."""
SHORTEST_PERIOD_S = 2.0
LONGEST_PERIOD_S = 20.0
"""Where `--period-s auto` looks."""
PERIOD_STEP_S = 0.1
"""A chosen period is a multiple of at least this, in whole cycles of the bus."""
MEASURED_S = 30.0
"""What a run records, if nobody says how many periods."""
LEAST_PERIODS = 3
"""Fewer tell little about the scatter between them."""
PICTURE_DPI = 150
LEAST_CYCLES = 10
"""Setpoints that a period of the highest harmonic needs at least."""
MOST_HARMONICS, MOST_RESTARTS, MOST_PERIODS = 50, 1000, 10_000
"""More is a slip of the finger."""


class CriterionName(StrEnum):
    """Criteria to choose from; see `information.named_criterion`."""

    A_OPTIMAL = "a-optimal"
    A_OPTIMAL_MEAN = "a-optimal-mean"
    A_OPTIMAL_MAX = "a-optimal-max"
    D_OPTIMAL = "d-optimal"
    CONDITION_NUMBER = "condition-number"


def design(
    robot: RobotArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="Excitation file to write; a picture goes beside it.")],
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same excitation.")] = 1,
    restarts: Annotated[int, typer.Option(min=1, max=MOST_RESTARTS, help="Random starts; the best one wins.")] = 8,
    harmonics: Annotated[int, typer.Option(min=1, max=MOST_HARMONICS, help="Harmonics of the Fourier series.")] = 5,
    period_s: Annotated[
        str,
        typer.Option(help="Duration of one period in s, or auto: as fast as torque, following error and rates allow."),
    ] = "10",
    periods: Annotated[
        int | None,
        typer.Option(
            min=1, max=MOST_PERIODS, help="Periods that a run records; if not given, 30 s and at least three."
        ),
    ] = None,
    criterion: Annotated[CriterionName, typer.Option(help="What is to be told best.")] = CriterionName.A_OPTIMAL,
) -> None:
    """Design an excitation for a robot's expected payload, at any time within all limits and clear of all obstacles."""
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_identification.excitation.design import design as design_excitation
    from armload_identification.excitation.excitation_file import write_excitation
    from armload_identification.excitation.information import named_criterion

    arm = load_robot(robot)
    screen = Screen()
    obstacles = arm.obstacles
    frequency = _frequency(arm, period_s, harmonics)
    if not arm.has_workspace:
        screen.step(
            f"note: {arm.file} has no [workspace]: nothing keeps this motion from the floor or from the arm itself"
        )
    envelope = arm.envelope(POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE)
    with _workers(restarts) as executor, screen.track("designing", restarts) as done:
        result = design_excitation(
            named_criterion(
                criterion, arm.chain, arm.limits.torque_noise_nm, arm.payloads.expected, arm.payloads.design_set
            ),
            envelope,
            harmonics=harmonics,
            base_frequency_hz=frequency,
            seed=seed,
            restarts=restarts,
            executor=executor,
            progress=lambda finished, _total, _best: done(finished),
            objection=obstacles.objection,
        )
    found_s = result.trajectory.period_s
    driven = periods or max(LEAST_PERIODS, ceil(MEASURED_S / found_s - 1e-9))
    command = (
        f"armload design {robot} --output {output.name} --seed {seed} --restarts {restarts} --harmonics {harmonics} "
        f"--period-s {period_s} --periods {driven} --criterion {criterion}"
    )
    excitation = result.excitation(driven, command, version("armload"))
    write_excitation(output, excitation)
    # imported here: drawing is slow to load, and commands that move an arm do not draw
    from armload_identification.report.figure_file import write_figure
    from armload_identification.report.path_figure import path_figure

    picture = output.with_suffix(".png")
    write_figure(picture, path_figure(excitation, envelope, arm.joint_names), PICTURE_DPI)
    screen.step(
        f"{output}: {criterion} cost {result.cost:.4g}, cond(Phi) {result.condition_number:.3g}, "
        f"{result.rank} of 10 parameters can be told, {driven} periods of {found_s:g} s"
    )
    screen.step(f"within every limit at any time; nearest: {_nearest(result, arm)}")
    screen.step(f"picture: {picture}")


@contextmanager
def _workers(restarts: int) -> Iterator[Executor | None]:
    """A process per core, none where one start is all there is."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    cores = min(restarts, len(os.sched_getaffinity(0)))
    if cores == 1:
        yield None
        return
    with ProcessPoolExecutor(cores, mp_context=get_context("spawn")) as executor:
        yield executor


def _frequency(arm: Robot, period_s: str, harmonics: int) -> float | PeriodRange:
    """The base frequency, or the range to choose the period from; both as the arm's bus can stream them."""
    from armload_identification.excitation.design_search import PeriodRange

    if period_s == "auto":
        cycle_s = 1 / arm.bus.cycle_hz
        step_s = ceil(PERIOD_STEP_S / cycle_s - 1e-9) * cycle_s
        shortest_s = max(SHORTEST_PERIOD_S, ceil(harmonics * LEAST_CYCLES * cycle_s / step_s - 1e-9) * step_s)
        return PeriodRange(shortest_s, LONGEST_PERIOD_S, step_s)
    try:
        seconds = float(period_s)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < inf:
        raise typer.BadParameter(f"{period_s!r} is no period: give seconds above 0, or auto")
    if arm.has_bus:
        _require_streamable(seconds, harmonics, arm.bus.cycle_hz)
    return 1 / seconds


def _require_streamable(period_s: float, harmonics: int, cycle_hz: float) -> None:
    """Refuse a period that setpoints at the bus's rate cannot follow."""
    from armload_controller.motion.setpoints import CYCLE_ROUNDING

    cycles = period_s * cycle_hz
    if abs(cycles - round(cycles)) > CYCLE_ROUNDING:
        near = [whole / cycle_hz for whole in (floor(cycles), ceil(cycles)) if whole > 0]
        raise typer.BadParameter(
            f"a period of {period_s:g} s is {cycles:.3f} cycles at {cycle_hz:g} Hz, and has to be a whole number: "
            f"give {' or '.join(f'{s:g}' for s in near)}"
        )
    if cycles < LEAST_CYCLES * harmonics:
        raise typer.BadParameter(
            f"harmonic {harmonics} of {period_s:g} s has {cycles / harmonics:.1f} setpoints a period at {cycle_hz:g} "
            f"Hz, at least {LEAST_CYCLES} are needed: give --period-s {LEAST_CYCLES * harmonics / cycle_hz:g} or more, "
            "or fewer --harmonics"
        )


def _nearest(result: DesignResult, arm: Robot) -> str:
    """The smallest room to every kind of limit."""
    room = result.margins
    parts = []
    for values, what, unit in (
        (room.position_rad, "range", "rad"),
        (room.velocity_rad_s, "speed", "rad/s"),
        (room.acceleration_rad_s2, "acceleration", "rad/s2"),
        (room.torque_nm, "torque", "N m"),
    ):
        joint = int(values.argmin())
        parts.append(f"{arm.joint_names[joint]} {what} {values[joint]:.3g} {unit}")
    if room.clearance_m:
        name = min(room.clearance_m, key=lambda key: room.clearance_m[key])
        parts.append(f"{name} {room.clearance_m[name]:.3g} m")
    return ", ".join(parts)
