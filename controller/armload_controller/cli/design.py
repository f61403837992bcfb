"""`armload design`: the excitation that tells most about a payload within the joints' limits."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import RobotArgument
from armload_controller.cli.screen import Screen
from armload_controller.config import load_robot
from armload_identification.excitation import design as design_excitation
from armload_identification.fourier import write_excitation

POSITION_MARGIN_RAD = 0.1
"""Room left to the position limits, for the ramps and the servo."""
RATE_SHARE = 0.7
"""Share of the speed and acceleration limits that the excitation uses; the phase ramps need the rest."""


def design(
    robot: RobotArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="Excitation file to write.")],
    seed: Annotated[int, typer.Option(help="Same seed, same excitation.")] = 1,
    restarts: Annotated[int, typer.Option(min=1, help="Random starts; the best one wins.")] = 8,
    harmonics: Annotated[int, typer.Option(min=1, help="Harmonics of the Fourier series.")] = 5,
    period_s: Annotated[float, typer.Option(min=0.1, help="Duration of one period in s.")] = 10.0,
    periods: Annotated[int, typer.Option(min=1, help="Periods that a run records.")] = 3,
    criterion: Annotated[str, typer.Option(help="a-optimal, or condition-number as in Chen 2016.")] = "a-optimal",
) -> None:
    """Design an excitation for a robot's expected payload."""
    arm = load_robot(robot)
    screen = Screen()
    with screen.track("designing", restarts) as done:
        result = design_excitation(
            arm.chain(),
            arm.excitation_limits().reduced(POSITION_MARGIN_RAD, RATE_SHARE),
            harmonics=harmonics,
            base_frequency_hz=1 / period_s,
            torque_noise_nm=arm.torque_noise_nm(),
            expected_payload=arm.expected_payload(),
            seed=seed,
            restarts=restarts,
            criterion=criterion,
            progress=lambda finished, _total, _best: done(finished),
        )
    command = (
        f"armload design {robot} --output {output.name} --seed {seed} --restarts {restarts} --harmonics {harmonics} "
        f"--period-s {period_s:g} --periods {periods} --criterion {criterion}"
    )
    write_excitation(output, result.excitation(periods, command, version("armload")))
    screen.step(
        f"{output}: {criterion} cost {result.cost:.4g}, cond(Phi) {result.condition_number:.3g}, "
        f"{result.rank} of 10 parameters can be told"
    )
