"""`armload design`: the most informative excitation for a payload, within all limits."""

from __future__ import annotations

from enum import StrEnum
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from armload_controller.cli.argument_names import as_options
from armload_controller.cli.options import CalibrationOption, RobotArgument, refuse_together
from armload_controller.cli.output.output_files import require_drawable, require_folder
from armload_controller.cli.screen import PLAIN, Screen

if TYPE_CHECKING:
    from armload_controller.analysis.robot_excitation import DesignedMotion

MOST_HARMONICS, MOST_RESTARTS, MOST_PERIODS = 50, 1000, 10_000
"""Larger values are taken as typing errors."""
_MOST_DEG = 180.0
_PARTS = 100
"""Steps of the progress."""


class Purpose(StrEnum):
    """Purpose of a motion."""

    PAYLOAD = "payload"
    ANY_MOTION = "any-motion"


_OPTIONS_OF = {
    Purpose.PAYLOAD: ("restarts", "harmonics", "period_s", "periods", "criterion"),
    Purpose.ANY_MOTION: ("at_rad", "within_deg", "mass_within", "speed_m_s", "calibration"),
}
"""Options that apply only to one purpose."""


class CriterionName(StrEnum):
    """Criteria to choose from; see `information.named_criterion`."""

    A_OPTIMAL = "a-optimal"
    A_OPTIMAL_MEAN = "a-optimal-mean"
    A_OPTIMAL_MAX = "a-optimal-max"
    D_OPTIMAL = "d-optimal"
    CONDITION_NUMBER = "condition-number"


def design_motion(
    context: typer.Context,
    robot: RobotArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Excitation file to write; a picture is written to the same folder.")
    ],
    purpose: Annotated[
        Purpose,
        typer.Option(
            "--for",
            help="payload: an excitation for two runs, empty and loaded. any-motion: the shortest motion about a "
            "position that determines the payload of a calibrated arm.",
        ),
    ] = Purpose.PAYLOAD,
    at_rad: Annotated[
        str | None,
        typer.Option(
            metavar="'Q1 Q2 ...'", help="any-motion: position of the arm; by default the middle of its excitation."
        ),
    ] = None,
    within_deg: Annotated[
        float, typer.Option(help="any-motion: greatest deviation of any joint from that position.")
    ] = 5.0,
    mass_within: Annotated[
        float,
        typer.Option(
            min=0.001, max=1.0, help="any-motion: half width of the mass's 95 % interval, as a fraction of the mass."
        ),
    ] = 0.02,
    speed_m_s: Annotated[
        float | None, typer.Option(min=0.01, help="any-motion: speed limit for all points of the arm, such as 0.25.")
    ] = None,
    calibration: CalibrationOption = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the random starts; the same seed gives the same excitation.")
    ] = 1,
    restarts: Annotated[
        int, typer.Option(min=1, max=MOST_RESTARTS, help="Number of random starts; the best result is used.")
    ] = 8,
    harmonics: Annotated[int, typer.Option(min=1, max=MOST_HARMONICS, help="Harmonics of the Fourier series.")] = 5,
    period_s: Annotated[
        str,
        typer.Option(help="Duration of one period in s, or auto: as short as torque, following error and rates allow."),
    ] = "5",
    periods: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_PERIODS, help="Periods that a run records; by default 30 s and at least three."),
    ] = None,
    criterion: Annotated[CriterionName, typer.Option(help="Criterion to optimise.")] = CriterionName.A_OPTIMAL,
    screen: Screen = PLAIN,
) -> None:
    """Design an excitation for a robot's expected payload, always within all limits and clear of all obstacles.

    With --for any-motion: the shortest motion, of a few degrees about the arm's position, that determines the payload
    of a calibrated arm.
    """
    from armload_controller.analysis.robot_excitation import DesignSearch, UnstreamablePeriod, design
    from armload_controller.config.robot import load_robot

    if output.suffix == ".png":
        raise typer.BadParameter(f"{output}: the picture gets this name; expected .toml", param_hint="--output")
    require_folder(output, "excitation")
    require_drawable(output.with_suffix(".png"), "picture", "--output")
    arm = load_robot(robot)
    if not arm.has_workspace:
        screen.step(
            f"note: {arm.file} has no [workspace]: collisions with the floor and between parts of the arm are not "
            "checked"
        )
    for of, names in _OPTIONS_OF.items():
        if of is not purpose:
            refuse_together(context, f"requires --for {of}", *names)
    if purpose is Purpose.ANY_MOTION:
        from armload_controller.analysis.robot_wiggle import WiggleRequest, design_wiggle

        with screen.track("designing", _PARTS) as done:
            wiggle = design_wiggle(
                arm,
                WiggleRequest(_radians(within_deg), mass_within, _positions(at_rad), speed_m_s),
                calibration=calibration,
                seed=seed,
                progress=lambda count, total: done(_PARTS * count // total),
            )
        _finish(screen, wiggle, output)
        return
    with screen.track("designing", restarts) as done:
        try:
            designed = design(
                arm,
                harmonics=harmonics,
                period_s=_period(period_s),
                periods=periods,
                search=DesignSearch(seed, restarts, criterion),
                progress=done,
            )
        except UnstreamablePeriod as error:
            raise typer.BadParameter(as_options(str(error))) from error
    _finish(screen, designed, output)


def _finish(screen: Screen, designed: DesignedMotion, output: Path) -> None:
    """Write the excitation and its picture, and show its figures."""
    picture = output.with_suffix(".png")
    designed.save(output)
    designed.picture(picture)
    screen.document(designed.to_dict, {"excitation": output, "picture": picture})
    screen.result(f"{output}: {designed}")
    screen.step(f"picture: {picture}")


def _radians(degrees: float) -> float:
    """An amplitude in rad."""
    if not 0.0 < degrees <= _MOST_DEG:
        raise typer.BadParameter(f"{degrees:g}: expected above 0, at most {_MOST_DEG:g}", param_hint="--within-deg")
    return radians(degrees)


def _positions(text: str | None) -> tuple[float, ...]:
    """Positions in rad."""
    try:
        return () if text is None else tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: expected one position in rad per joint, such as '0 -0.5 1.2 0 0.3 0'", param_hint="--at-rad"
        ) from None


def _period(text: str) -> float | Literal["auto"]:
    """Seconds, or auto."""
    if text == "auto":
        return "auto"
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise typer.BadParameter(
            f"{text!r} is not a period: give a number of seconds above 0, or auto", param_hint="--period-s"
        )
    return seconds
