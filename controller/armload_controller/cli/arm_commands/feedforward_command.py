"""`armload feedforward`: the payload's torque in the loop, and its effect on the following error."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
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
from armload_controller.cli.output.feedforward_output import offset_account, show_comparisons
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.cli.output.output_files import require_folder
from armload_controller.motion.motion_control import MotionControl

if TYPE_CHECKING:
    from armload_controller.analysis.arm_in_use import ArmInUse
    from armload_controller.config.robot import Robot
    from armload_controller.feedforward.adaptation import AdaptationDecision
    from armload_controller.feedforward.adaptation_rules import DeclaredMass
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.motion.checked_path import CheckedPath
    from armload_controller.session.feedforward_comparison import ComparisonRuns, FollowingComparison
    from armload_controller.session.run_session import Load, Operator, RunSession, ServosFactory
    from armload_identification.model.payload import PayloadResult

IDENTIFIED, IDEAL = "identified payload", "true payload"
FRICTION, ARM = "payload and its friction in the gears", "payload and arm"
PERIODS = 1


def feedforward(
    robot: RobotArgument,
    payload: Annotated[
        Path | None,
        typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to feed forward; omitted with --adapt."),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option(
            "--compare",
            help="Run one trajectory without and with feed-forward; by default only the torque offset is tried.",
        ),
    ] = False,
    adapt: Annotated[
        bool,
        typer.Option(
            "--adapt", help="Adapt the torque to the payload that is estimated during the run; requires a calibration."
        ),
    ] = False,
    expect: Annotated[
        str | None, typer.Option(metavar="KG..KG", help="With --adapt: range of the possible payload, such as 0..3.")
    ] = None,
    decisions: Annotated[
        Path, typer.Option(help="With --adapt: log of every decision, one line of JSON each; lines are appended.")
    ] = Path("adaptation.jsonl"),
    excitation: Annotated[
        Path | None, typer.Option(help="Trajectory to run; by default the robot's validation excitation.")
    ] = None,
    calibration: CalibrationOption = None,
    mounted: MountedOption = None,
    picture: Annotated[Path, typer.Option(help="Picture of the comparison, .svg or .png.")] = Path("feedforward.svg"),
    bus: BusOption = None,
    bitrate: BitrateOption = None,
    cycle_hz: CycleOption = None,
    simulated_drives: SimulatedDrivesOption = False,
    yes: YesOption = False,
    live: LiveOption = False,
    live_address: LiveAddressOption = None,
    as_json: JsonOption = False,
) -> None:
    """Add a payload's torque to that of the drives (60B2): the trial at standstill, and with --compare its effect.

    In the trial a fifth of the torque is faded in and out, and each drive's response must match the command.

    With a calibration of the arm, torque is scaled by the calibrated gains, and the comparison has two more runs: with
    the friction that the payload causes in the gears, and with all of the arm's own torque.

    With --adapt no payload is given: the payload is estimated while the arm moves, and fed forward as long as all
    conditions are met. On a real arm this requires separate consent, even with --yes.

    Ctrl-C, SIGTERM and a lost terminal bring the arm to rest and remove its torque, as for `commission`.
    """
    from armload_controller.analysis.arm_in_use import arm_in_use
    from armload_controller.cli.keyboard import Keyboard
    from armload_controller.cli.output.result_documents import feedforward_document
    from armload_controller.cli.screen import Screen
    from armload_controller.feedforward.adaptation_rules import DeclaredMass
    from armload_controller.session.arm_access import open_arm, require_rules
    from armload_controller.session.comparison_figure import require_picture
    from armload_controller.session.live.live_view import live_at
    from armload_controller.session.run_session import Load
    from armload_drivers.servos import JointServos

    require_one_kind(payload, expect, adapt=adapt, compare=compare)
    arm = arm_on_bus(robot, bus, bitrate, cycle_hz)
    require_rules(arm, simulated_drives=simulated_drives, attended=attended())
    if mounted is not None:
        arm = arm.with_simulated_payload(mounted)
    if compare:
        require_picture(picture)
        require_folder(picture)
    control = MotionControl()
    screen = Screen(Keyboard.of_this_process(control), as_json=as_json)
    given = declared_mass(arm, expect) if payload is None else _usable(arm, payload)
    path = _checked_path(arm, excitation, whole=adapt)
    used = arm_in_use(arm, calibration)

    def open_servos(load: Load) -> AbstractContextManager[JointServos]:
        return open_arm(arm, load, screen.step, simulated_drives=simulated_drives, attended=attended())

    with operator_at(arm, screen, control, agreed=yes, live=live_at(live, live_address)) as operator:
        bench = _Bench(arm, path, used, open_servos, operator)
        if isinstance(given, DeclaredMass):
            outcome = _adapt(bench, given, decisions)
        elif compare:
            outcome = _compare(bench, given)
        else:
            with bench.session(Load.LOADED) as session:
                outcome = _Outcome(bench.runs().try_offset(session, given))
    if compare:
        show_comparisons(screen, outcome.comparisons, arm.name, picture)
    else:
        screen.result(offset_account(outcome.verdict))
    document = partial(feedforward_document, arm.name, outcome.verdict, outcome.comparisons, outcome.decisions)
    screen.document(document, {"picture": picture if compare else None})


@dataclass(frozen=True)
class _Bench:
    """What every run of the command requires.

    Attributes:
        arm: The arm.
        path: The checked trajectory.
        used: The arm as calibrated, if it is.
        open_servos: Opens the arm.
        operator: The person at the arm.
    """

    arm: Robot
    path: CheckedPath
    used: ArmInUse
    open_servos: ServosFactory
    operator: Operator

    def session(self, load: Load) -> AbstractContextManager[RunSession]:
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
class _Outcome:
    """Result of the command.

    Attributes:
        verdict: Result of the torque offset check.
        comparisons: Following errors without and with feed-forward.
        decisions: Decisions of an adapted run.
    """

    verdict: OffsetVerdict
    comparisons: Sequence[FollowingComparison] = ()
    decisions: Sequence[AdaptationDecision] = ()


def _usable(arm: Robot, payload: Path) -> PayloadResult:
    """A payload that may be fed forward."""
    from armload_controller.feedforward.feedforward_plugin import PayloadRefused
    from armload_controller.feedforward.payload_use import why_not_usable
    from armload_identification.files.payload_file import read_payload

    result = read_payload(payload)
    problem = why_not_usable(result, arm.chain, arm.name, "fed forward")
    if problem is not None:
        raise PayloadRefused(f"{payload}: {problem}")
    return result


def require_one_kind(payload: Path | None, expect: str | None, *, adapt: bool, compare: bool) -> None:
    """Refuse options that contradict each other.

    Raises:
        BadParameter: naming the option.
    """
    if adapt and payload is not None:
        raise typer.BadParameter("takes no PAYLOAD: the payload is estimated", param_hint="--adapt")
    if adapt and compare:
        raise typer.BadParameter("requires a PAYLOAD and cannot be combined with --adapt", param_hint="--compare")
    if adapt and expect is None:
        raise typer.BadParameter(
            "required with --adapt: the range of the possible payload, such as 0..3", param_hint="--expect"
        )
    if not adapt and expect is not None:
        raise typer.BadParameter("requires --adapt", param_hint="--expect")
    if not adapt and payload is None:
        raise typer.BadParameter("give a payload file, or --adapt", param_hint="PAYLOAD")


def declared_mass(arm: Robot, expect: str | None) -> DeclaredMass:
    """The range of mass that the operator expects.

    Raises:
        BadParameter: the text is not a range.
        AdaptationRefused: the range is empty or too high.
    """
    from armload_controller.feedforward.adaptation_rules import DeclaredMass

    try:
        least_kg, most_kg = (float(part.strip().removesuffix("kg")) for part in (expect or "").split(".."))
    except ValueError:
        raise typer.BadParameter(f"{expect!r}: expected a range such as 0..3", param_hint="--expect") from None
    return DeclaredMass(least_kg, most_kg, arm.payloads.rated_kg)


def _adapt(bench: _Bench, declared: DeclaredMass, decisions: Path) -> _Outcome:
    """The run with torque adapted to the estimate; every decision is shown and logged immediately."""
    from armload_controller.cycle.realtime import running_worker
    from armload_controller.feedforward.adaptation import at_once
    from armload_controller.session.adapted_run import adapted_run
    from armload_controller.session.decision_log import DecisionLog
    from armload_controller.session.run_session import Load

    arm, display = bench.arm, bench.operator.display
    calibration, _ = bench.used.calibrated("--adapt requires a calibrated arm")
    with DecisionLog(decisions, arm.name, display) as log, running_worker("estimate") as executor:
        beside = at_once if arm.bus.in_virtual_time else executor.submit
        with bench.session(Load.LOADED) as session:
            adapted = adapted_run(bench.path, calibration, declared, session, beside, log.report)
    display.step(f"written: {decisions}, {len(adapted.decisions)} decisions")
    return _Outcome(adapted.verdict, decisions=adapted.decisions)


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


def _compare(bench: _Bench, payload: PayloadResult) -> _Outcome:
    """All runs; in simulation also those of the empty arm and of the true payload. The smallest addition is first."""
    import numpy as np

    from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction
    from armload_controller.session.feedforward_comparison import FollowingRun
    from armload_controller.session.run_session import Load

    arm, used, runs = bench.arm, bench.used, bench.runs()
    in_this_process = arm.bus.in_virtual_time
    body = None if used.calibration is None else used.calibration.body
    empty: FollowingRun | None = None
    if in_this_process:
        with bench.session(Load.UNLOADED) as session:
            empty = runs.plain(session, "empty")
    with bench.session(Load.LOADED) as session:
        without = runs.plain(session, "loaded, without feed-forward")
        fed, verdict = runs.with_feedforward(session, payload, "loaded, with feed-forward", None)
        bench.operator.display.step(offset_account(verdict))
        results = {IDENTIFIED: fed}
        if body is not None:
            for label, term in ((FRICTION, LoadFriction(used.chain, body)), (ARM, ArmTorque(used.chain, body))):
                results[label], _ = runs.with_feedforward(session, payload, f"loaded, {label}", verdict, term)
        if in_this_process:
            truth = arm.simulation.payload(arm.simulation.payload_name)
            true = replace(payload, model=truth, determined=np.ones(10, dtype=np.bool_))
            results[IDEAL], _ = runs.with_feedforward(session, true, f"loaded, {IDEAL}", verdict)

    def chosen(*left_out: str) -> dict[str, FollowingRun]:
        return {label: run for label, run in results.items() if label not in left_out}

    # Without a run of the empty arm only the lag can be subtracted. The arm's own torque would change the empty arm's
    # error.
    comparisons = [] if empty is None else [runs.compare(without, chosen(ARM), empty, payload)]
    if empty is None or body is not None:
        comparisons.append(runs.compare(without, chosen(IDEAL), None, payload))
    return _Outcome(verdict, comparisons)
