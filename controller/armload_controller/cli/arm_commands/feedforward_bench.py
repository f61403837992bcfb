"""The arm, its trajectory and its operator, as every `armload feedforward` command uses them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.attendance import attended, operator_at
from armload_controller.cli.given_arm import arm_on_bus
from armload_controller.cli.options import (
    BitrateOption,
    BusOption,
    CalibrationOption,
    CycleOption,
    LiveAddressOption,
    LiveOption,
    MountedOption,
    RobotArgument,
    SimulatedDrivesOption,
    YesOption,
)
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.motion.motion_control import MotionControl

if TYPE_CHECKING:
    from armload_controller.analysis.arm_in_use import ArmInUse
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.motion.checked_path import CheckedPath
    from armload_controller.session.feedforward_comparison import ComparisonRuns
    from armload_controller.session.run_session import Operator, RunSession, ServosFactory, SessionLoad
    from armload_drivers.servos import JointServos
    from armload_identification.model.payload import PayloadResult

PERIODS = 1

ExcitationOption = Annotated[
    Path | None,
    typer.Option("--excitation", help="Trajectory to run; by default the robot's validation excitation."),
]
PayloadArgument = Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to feed forward.")]


@dataclass(frozen=True)
class Bench:
    """What every run requires.

    Attributes:
        arm: The arm.
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
class BenchOptions:
    """Options that all feed-forward commands share, in the order of their help."""

    robot: RobotArgument
    excitation: ExcitationOption = None
    calibration: CalibrationOption = None
    mounted: MountedOption = None
    bus: BusOption = None
    bitrate: BitrateOption = None
    cycle_hz: CycleOption = None
    simulated_drives: SimulatedDrivesOption = False
    yes: YesOption = False
    live: LiveOption = False
    live_address: LiveAddressOption = None
    as_json: JsonOption = False

    def arm(self) -> Robot:
        """The arm, if it may be moved.

        Raises:
            ConfigurationError: its file cannot be used, or lacks what a real arm requires.
            UnsafeBus: a real arm without an operator.
        """
        from armload_controller.session.arm_access import require_rules

        arm = arm_on_bus(self.robot, self.bus, self.bitrate, self.cycle_hz)
        require_rules(arm, simulated_drives=self.simulated_drives, attended=attended())
        return arm if self.mounted is None else arm.with_simulated_payload(self.mounted)

    @contextmanager
    def bench(self, arm: Robot, *, whole: bool = False) -> Iterator[Bench]:
        """The arm with its trajectory, one period of it or all, checked; within the block the operator can stop it."""
        from armload_controller.analysis.arm_in_use import arm_in_use
        from armload_controller.cli.keyboard import Keyboard
        from armload_controller.cli.screen import Screen
        from armload_controller.session.arm_access import open_arm
        from armload_controller.session.live.live_view import live_at

        control = MotionControl()
        screen = Screen(Keyboard.of_this_process(control), as_json=self.as_json)
        path = _checked_path(arm, self.excitation, whole=whole)
        used = arm_in_use(arm, self.calibration)

        def open_servos(load: SessionLoad) -> AbstractContextManager[JointServos]:
            return open_arm(arm, load, screen.step, simulated_drives=self.simulated_drives, attended=attended())

        live = live_at(self.live, self.live_address)
        with operator_at(arm, screen, control, agreed=self.yes, live=live) as operator:
            yield Bench(arm, path, used, open_servos, operator, screen)


def with_bench_options(command: Callable[..., None]) -> Callable[..., None]:
    """A command with the options of `BenchOptions`, which it gets as its first argument, `options`."""
    robot, *shared = inspect.signature(BenchOptions, eval_str=True).parameters.values()
    _, *own = inspect.signature(command, eval_str=True).parameters.values()

    @wraps(command)
    def given(**values: object) -> None:
        names = [each.name for each in own]
        options = {name: value for name, value in values.items() if name not in names}
        command(BenchOptions(**options), **{name: values[name] for name in names})  # type: ignore[arg-type]

    given.__signature__ = inspect.Signature([robot, *own, *shared])  # type: ignore[attr-defined]
    return given


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
    run = chosen if whole else Excitation(chosen.trajectory, PERIODS)
    return check_path(run, arm.motion_constraints, 1 / arm.bus.cycle_hz, file=file, key=key)
