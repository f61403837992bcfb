"""The arm, its trajectory and its operator, as every `armload feedforward` command uses them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.attendance import operator_at
from armload_controller.cli.given_arm import DrivenArm
from armload_controller.cli.options import (
    CalibrationOption,
    LiveAddressOption,
    LiveOption,
    MountedOption,
    YesOption,
)
from armload_controller.cli.output.json_output import JsonOption

if TYPE_CHECKING:
    from armload_controller.analysis.arm_in_use import ArmInUse
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.motion.checked_path import CheckedPath
    from armload_controller.session.feedforward_comparison import ComparisonRuns
    from armload_controller.session.run_session import Operator, RunSession, ServosFactory
    from armload_controller.session.session_load import SessionLoad
    from armload_identification.model.payload import PayloadResult

ExcitationOption = Annotated[
    Path | None,
    typer.Option("--excitation", help="Trajectory to run; by default the robot's validation excitation."),
]
PayloadArgument = Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to feed forward.")]


@dataclass(frozen=True)
class Bench:
    """What every run requires.

    Attributes:
        path: The checked trajectory.
        used: The arm as calibrated, if it is.
        open_servos: Opens the arm.
        operator: The person at the arm.
        screen: What the person sees.
    """

    arm: Robot
    path: CheckedPath
    used: ArmInUse
    open_servos: ServosFactory
    operator: Operator
    screen: Screen

    def session(self, load: SessionLoad) -> AbstractContextManager[RunSession]:
        """A session with a load on the flange."""
        from armload_controller.session.run_session import run_session

        return run_session(self.arm, load, self.open_servos, self.operator)

    def runs(self) -> ComparisonRuns:
        """Runs that use the arm's calibration, if any."""
        from armload_controller.feedforward.body_torque import held_torque
        from armload_controller.session.feedforward_comparison import ComparisonRuns

        known = self.used.calibration
        if known is None:
            return ComparisonRuns(self.arm, self.path)
        return ComparisonRuns(self.arm, self.path, held_torque(known.body), known.commanded(self.arm.drives.coupling))


@dataclass(frozen=True)
class BenchOptions(DrivenArm):
    """Options that all feed-forward commands share, in the order of their help."""

    excitation: ExcitationOption = None
    calibration: CalibrationOption = None
    mounted: MountedOption = None
    yes: YesOption = False
    live: LiveOption = False
    live_address: LiveAddressOption = None
    as_json: JsonOption = False

    def movable_arm(self) -> Robot:
        """The arm, if it may be moved.

        Raises:
            ConfigurationError: its file cannot be used, or lacks what a real arm requires.
            UnsafeBus: a real arm without an operator.
        """
        arm = self.arm(self.cycle_hz)
        self.require_rules(arm)
        return arm if self.mounted is None else arm.with_simulated_payload(self.mounted)

    @contextmanager
    def bench(self, arm: Robot, *, whole: bool = False) -> Iterator[Bench]:
        """The arm with its trajectory, one period of it or all, checked; within the block the operator can stop it."""
        from armload_controller.analysis.arm_in_use import arm_in_use
        from armload_controller.cli.screen import Screen
        from armload_controller.session.live.live_view import live_at

        screen = Screen(self.as_json)
        path = _checked_path(arm, self.excitation, whole=whole)
        used = arm_in_use(arm, self.calibration)
        live = live_at(self.live, self.live_address)
        with operator_at(arm, screen, agreed=self.yes, live=live) as operator:
            yield Bench(arm, path, used, self.opened(arm, screen), operator, screen)


def usable(arm: Robot, payload: Path) -> PayloadResult:
    """A payload that may be fed forward."""
    from armload_controller.feedforward.feedforward_plugin import PayloadRefused
    from armload_controller.feedforward.payload_use import why_not_usable
    from armload_identification.files.payload_file import read_payload

    result = read_payload(payload)
    problem = why_not_usable(result, arm.chain, arm.name, "fed forward")
    if problem is not None:
        raise PayloadRefused(f"{payload}: {problem}")
    return result


def _checked_path(arm: Robot, excitation: Path | None, *, whole: bool) -> CheckedPath:
    """The trajectory to run, one period of it or all of them, checked."""
    from armload_controller.motion.checked_path import check_path
    from armload_controller.session.commissioning import require_excitation
    from armload_identification.excitation.excitation_file import read_excitation
    from armload_identification.excitation.fourier import Excitation

    if excitation is None:
        chosen, file, key = require_excitation(arm, "validation"), arm.file, "excitation.validation"
    else:
        chosen, file, key = read_excitation(excitation), "command line", f"--excitation {excitation}"
    run = chosen if whole else Excitation(chosen.trajectory, periods=1)
    return check_path(run, arm.motion_constraints, 1 / arm.bus.cycle_hz, file=file, key=key)
