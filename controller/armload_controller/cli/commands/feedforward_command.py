"""`armload feedforward`: the payload's torque in the loop, and what it does to the following error."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.attendance import attended
from armload_controller.cli.options import (
    BitrateOption,
    CalibrationOption,
    ChannelOption,
    CycleOption,
    InterfaceOption,
    LiveAddressOption,
    LiveOption,
    RobotArgument,
    SimulatedDrivesOption,
    YesOption,
)
from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.motion.motion_control import MotionControl

if TYPE_CHECKING:
    from rich.table import Table

    from armload_controller.analysis.arm_in_use import ArmInUse
    from armload_controller.config.robot import Robot
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.motion.checked_path import CheckedPath
    from armload_controller.session.feedforward_comparison import Comparison, ComparisonRuns
    from armload_controller.session.run_session import Operator, ServosFactory
    from armload_identification.model.payload import InertialParameters, PayloadResult

IDENTIFIED, IDEAL = "identified payload", "true payload"
FRICTION, ARM = "and its friction in the gears", "payload and arm"
PERIODS = 1


def feedforward(
    robot: RobotArgument,
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to feed forward.")],
    compare: Annotated[
        bool, typer.Option("--compare", help="Run one trajectory without and with; else only try the torque offset.")
    ] = False,
    excitation: Annotated[
        Path | None, typer.Option(help="Trajectory to run; the robot's validation excitation if not given.")
    ] = None,
    calibration: CalibrationOption = None,
    mounted: Annotated[
        str | None, typer.Option("--mounted", help="Payload on the simulated flange, by its name in the configuration.")
    ] = None,
    picture: Annotated[Path, typer.Option(help="Picture of the comparison, .svg or .png.")] = Path("feedforward.svg"),
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    cycle_hz: CycleOption = None,
    simulated_drives: SimulatedDrivesOption = False,
    yes: YesOption = False,
    live: LiveOption = False,
    live_address: LiveAddressOption = None,
    as_json: JsonOption = False,
) -> None:
    """Add a payload's torque to the drives' own (60B2), after trying it at standstill; compare with the arm's as well.

    With a calibration of the arm, torque is scaled to what its drives make of it, and the comparison has two runs more:
    with the friction that the payload causes in the gears, and with all of the arm's own torque.

    Ctrl-C, SIGTERM and a lost terminal bring the arm to rest and remove its torque, as for `commission`.
    """
    from armload_controller.analysis.arm_in_use import arm_in_use
    from armload_controller.cli.keyboard import Keyboard
    from armload_controller.cli.output.result_documents import feedforward_document
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.feedforward.body_torque import held_torque
    from armload_controller.feedforward.injection import PayloadRefused
    from armload_controller.feedforward.payload_use import why_not_usable
    from armload_controller.session.arm_access import open_arm, require_rules
    from armload_controller.session.comparison_figure import draw, require_picture
    from armload_controller.session.feedforward_comparison import ComparisonRuns
    from armload_controller.session.live_view import live_at, shown_live
    from armload_controller.session.run_session import Consent, Load, Operator, run_session
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.servos import JointServos
    from armload_identification.files.payload_file import read_payload

    arm = load_robot(robot).with_bus(interface, channel, bitrate, cycle_hz)
    require_rules(arm, simulated_drives=simulated_drives, attended=attended())
    if mounted is not None:
        arm = arm.with_simulated_payload(mounted)
    require_picture(picture)
    control = MotionControl()
    screen = Screen(Keyboard.of_this_process(control), as_json=as_json)
    result = read_payload(payload)
    problem = why_not_usable(result, arm.chain, arm.name, "fed forward")
    if problem is not None:
        raise PayloadRefused(f"{payload}: {problem}")
    path = _checked_path(arm, excitation)
    used = arm_in_use(arm, calibration)
    known = used.calibration
    model = None if known is None else known.body
    runs = ComparisonRuns(
        arm,
        path,
        None if model is None else held_torque(model),
        None if known is None else known.commanded(arm.drives.coupling),
    )

    def open_servos(load: Load) -> AbstractContextManager[JointServos]:
        return open_arm(arm, load, screen.step, simulated_drives=simulated_drives)

    with ExitStack() as stack:
        signals = stack.enter_context(StopSignals(control))
        consent = Consent(lambda question: signals.ask(question, screen.confirm), given=yes)
        operator = stack.enter_context(shown_live(Operator(screen, control, consent), arm, live_at(live, live_address)))
        if not compare:
            with run_session(arm, Load.LOADED, open_servos, operator) as session:
                verdict = runs.try_offset(session, result)
            screen.result(_account(verdict))
            if as_json:
                print_document(feedforward_document(arm.name, verdict, [], None))
            return
        comparisons, verdict = _compare(arm, runs, result, used, open_servos, operator)
    for comparison in comparisons:
        screen.table(comparison_table(comparison))
    draw(comparisons, arm.name, picture)
    screen.step(f"picture: {picture}")
    if as_json:
        print_document(feedforward_document(arm.name, verdict, comparisons, picture))


def _checked_path(arm: Robot, excitation: Path | None) -> CheckedPath:
    """The trajectory to run, one period of it, checked."""
    from armload_controller.motion.checked_path import check_path
    from armload_controller.session.commissioning import require_excitation
    from armload_identification.excitation.excitation_file import read_excitation
    from armload_identification.excitation.fourier import Excitation

    if excitation is None:
        chosen, file, key = require_excitation(arm, "validation"), arm.file, "excitation.validation"
    else:
        chosen, file, key = read_excitation(excitation), "command line", f"--excitation {excitation}"
    one = Excitation(chosen.trajectory, PERIODS)
    return check_path(one, arm.motion_constraints, 1 / arm.bus.cycle_hz, file=file, key=key)


def _compare(
    arm: Robot,
    runs: ComparisonRuns,
    payload: PayloadResult,
    used: ArmInUse,
    open_servos: ServosFactory,
    operator: Operator,
) -> tuple[list[Comparison], OffsetVerdict]:
    """All runs; in simulation the empty arm's and the true payload's too. The mildest addition comes first."""
    from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction
    from armload_controller.session.arm_access import VIRTUAL
    from armload_controller.session.feedforward_comparison import FollowingRun
    from armload_controller.session.run_session import Load, run_session

    in_this_process = arm.bus.interface == VIRTUAL
    body = None if used.calibration is None else used.calibration.body
    empty: FollowingRun | None = None
    if in_this_process:
        with run_session(arm, Load.UNLOADED, open_servos, operator) as session:
            empty = runs.plain(session, "empty")
    with run_session(arm, Load.LOADED, open_servos, operator) as session:
        without = runs.plain(session, "loaded, without feed-forward")
        fed, verdict = runs.with_feedforward(session, payload, "loaded, with feed-forward", None)
        operator.display.step(_account(verdict))
        results = {IDENTIFIED: fed}
        if body is not None:
            for label, term in ((FRICTION, LoadFriction(used.chain, body)), (ARM, ArmTorque(used.chain, body))):
                results[label], _ = runs.with_feedforward(session, payload, f"loaded, {label}", verdict, term)
        if in_this_process:
            truth = arm.simulation.payload(arm.simulation.payload_name)
            true = _as_result(payload, truth)
            results[IDEAL], _ = runs.with_feedforward(session, true, "loaded, with the true one", verdict)

    def chosen(*left_out: str) -> dict[str, FollowingRun]:
        return {label: run for label, run in results.items() if label not in left_out}

    # Without the empty arm's error there is nothing to take off but the lag; the arm's own torque changes that error.
    comparisons = [] if empty is None else [runs.compare(without, chosen(ARM), empty, payload)]
    if empty is None or body is not None:
        comparisons.append(runs.compare(without, chosen(IDEAL), None, payload))
    return comparisons, verdict


def _as_result(payload: PayloadResult, truth: InertialParameters) -> PayloadResult:
    import numpy as np

    return replace(payload, model=truth, determined=np.ones(10, dtype=np.bool_))


def _account(verdict: OffsetVerdict) -> str:
    """What the check found, in a line."""
    used = [
        f"{name} {100 * gain:.0f} %"
        for name, gain, usable in zip(verdict.joint_names, verdict.gain, verdict.usable, strict=True)
        if usable
    ]
    left = [name for name, usable in zip(verdict.joint_names, verdict.usable, strict=True) if not usable]
    text = f"torque offset tried at standstill, answered with: {', '.join(used)}"
    return text + (f"; no torque is added on {', '.join(left)}: too little weight, or an uneven answer" if left else "")


def comparison_table(comparison: Comparison) -> Table:
    """RMS of the error per joint, and how much less it is with feed-forward."""
    from rich.table import Table

    from armload_controller.session.feedforward_comparison import Measure

    what = comparison.measure
    table = Table(title=f"{what[0].upper()}{what[1:]}, RMS over time", title_justify="left")
    table.add_column("joint")
    for column in ("weight N m", "without mrad", *comparison.with_rad):
        table.add_column(column, justify="right")
    for i, name in enumerate(comparison.joint_names):
        shares = [f"{100 * comparison.reduction(label)[i]:.1f} % less" for label in comparison.with_rad]
        mark = " *" if i in comparison.gravity_loaded else ""
        weight, before = comparison.weight_nm[i], 1e3 * comparison.without_rms_rad[i]
        table.add_row(name + mark, f"{weight:.1f}", f"{before:.3f}", *shares)
    table.caption = "* carries the payload's weight"
    if comparison.measure is Measure.TORQUES:
        table.caption += (
            ". What follows from the commanded motion alone, the servo's lag, is taken off every run; what is left is "
            "due to torque (weight, inertia, friction) and to an uneven cycle"
        )
    return table
