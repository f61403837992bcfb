"""`armload design`: the excitation that says most about a payload, within all limits."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from armload_controller.cli.options import RobotArgument
from armload_controller.cli.output.json_output import JsonOption, print_document

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
    criterion: Annotated[CriterionName, typer.Option(help="What to optimise.")] = CriterionName.A_OPTIMAL,
    as_json: JsonOption = False,
) -> None:
    """Design an excitation for a robot's expected payload, at any time within all limits and clear of all obstacles."""
    from armload_controller.analysis.robot_excitation import UnstreamablePeriod
    from armload_controller.analysis.robot_excitation import design as design_excitation
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot

    arm = load_robot(robot)
    screen = Screen(as_json=as_json)
    if not arm.has_workspace:
        screen.step(
            f"note: {arm.file} has no [workspace]: nothing keeps this motion from the floor or from the arm itself"
        )
    with screen.track("designing", restarts) as done:
        try:
            designed = design_excitation(
                arm,
                seed=seed,
                restarts=restarts,
                harmonics=harmonics,
                period_s=_period(period_s),
                periods=periods,
                criterion=criterion,
                progress=done,
            )
        except UnstreamablePeriod as error:
            raise typer.BadParameter(str(error)) from error
    designed.save(output)
    picture = output.with_suffix(".png")
    designed.picture(picture)
    if as_json:
        print_document(designed.to_dict() | {"files": {"excitation": str(output), "picture": str(picture)}})
    screen.result(f"{output}: {designed}")
    screen.step(f"picture: {picture}")


def _period(text: str) -> float | Literal["auto"]:
    """Seconds, or auto."""
    if text == "auto":
        return "auto"
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise typer.BadParameter(f"{text!r} is no period: give seconds above 0, or auto")
    return seconds
