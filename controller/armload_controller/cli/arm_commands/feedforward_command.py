"""`armload feedforward`: the payload's torque in the drives (60B2), tried, compared and run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.arm_commands.feedforward_bench import Bench, BenchOptions, PayloadArgument, usable
from armload_controller.cli.command_group import Commands
from armload_controller.cli.output.feedforward_output import offset_account, show_comparisons
from armload_controller.cli.output.output_files import require_folder

if TYPE_CHECKING:
    from armload_controller.config.robot import Robot
    from armload_controller.feedforward.adaptation import AdaptationDecision
    from armload_controller.feedforward.adaptation_rules import DeclaredMass
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.session.feedforward_comparison import FollowingComparison, FollowingRun
    from armload_identification.model.payload import PayloadResult

IDENTIFIED, IDEAL = "identified payload", "true payload"
FRICTION, ARM = "payload and its friction in the gears", "payload and arm"

feedforward = Commands(
    "Add a payload's torque to that of the drives (60B2), which is tried at standstill before anything moves."
)


@feedforward.command("trial")
def feedforward_trial(options: BenchOptions, payload: PayloadArgument) -> None:
    """Fade a fifth of the payload's torque in and out at standstill: each drive's response must match the command.

    Nothing moves. With a calibration of the arm, torque is scaled by the calibrated gains.
    """
    from armload_controller.cli.output.json_documents import feedforward_document
    from armload_controller.session.run_session import SessionLoad

    arm = options.movable_arm()
    given = usable(arm, payload)
    with options.bench(arm) as bench:
        with bench.session(SessionLoad.LOADED) as session:
            verdict = bench.runs().try_offset(session, given)
        bench.screen.result(offset_account(verdict))
        bench.screen.document(partial(feedforward_document, arm.name, verdict, (), ()))


@feedforward.command("compare")
def feedforward_compare(
    options: BenchOptions,
    payload: PayloadArgument,
    picture: Annotated[Path, typer.Option(help="Picture of the comparison, .svg or .png.")] = Path("feedforward.svg"),
) -> None:
    """Run one trajectory without and with feed-forward, and show its effect on the following error.

    The torque is first tried at standstill, as by `trial`. With a calibration of the arm, torque is scaled by the
    calibrated gains, and there are two more runs: with the friction that the payload causes in the gears, and with all
    of the arm's own torque.
    """
    from armload_controller.cli.output.json_documents import feedforward_document
    from armload_controller.session.comparison_figure import require_picture

    arm = options.movable_arm()
    require_picture(picture)
    require_folder(picture)
    given = usable(arm, payload)
    with options.bench(arm) as bench:
        verdict, comparisons = _compare(bench, given)
        show_comparisons(bench.screen, comparisons, arm.name, picture)
        document = partial(feedforward_document, arm.name, verdict, comparisons, ())
        bench.screen.document(document, {"picture": picture})


@feedforward.command("run")
def feedforward_run(
    options: BenchOptions,
    payload: Annotated[
        Path | None,
        typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to feed forward; omitted with --expect."),
    ] = None,
    expect: Annotated[
        str | None,
        typer.Option(
            metavar="KG..KG",
            help="Instead of PAYLOAD: estimate the payload during the run and adapt the torque to it, within this "
            "range, such as 0..3; requires a calibration.",
        ),
    ] = None,
    decisions: Annotated[
        Path, typer.Option(help="With --expect: log of every decision, one line of JSON each; lines are appended.")
    ] = Path("adaptation.jsonl"),
) -> None:
    """Run a trajectory with the payload's torque added to that of the drives (60B2), tried at standstill first.

    With --expect the payload is estimated while the arm moves, and fed forward as long as all conditions are met. On a
    real arm this requires separate consent, even with --yes.

    Ctrl-C, SIGTERM and a lost terminal bring the arm to rest and remove its torque, as for `commission`.
    """
    from armload_controller.cli.output.json_documents import feedforward_document
    from armload_controller.session.run_session import SessionLoad

    _require_one_kind(payload, expect)
    arm = options.movable_arm()
    declared = None if expect is None else _declared_mass(arm, expect)
    given = None if payload is None else usable(arm, payload)
    made: Sequence[AdaptationDecision] = ()
    with options.bench(arm, whole=True) as bench:
        if declared is not None:
            verdict, made = _adapt(bench, declared, decisions)
        elif given is not None:
            with bench.session(SessionLoad.LOADED) as session:
                _, verdict = bench.runs().with_feedforward(session, given, "loaded, with feed-forward", None)
        bench.screen.result(offset_account(verdict))
        bench.screen.document(partial(feedforward_document, arm.name, verdict, (), made))


def _compare(bench: Bench, payload: PayloadResult) -> tuple[OffsetVerdict, list[FollowingComparison]]:
    """All runs; in simulation also those of the empty arm and of the true payload. The smallest addition is first."""
    import numpy as np

    from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction
    from armload_controller.session.run_session import SessionLoad

    arm, used, runs = bench.arm, bench.used, bench.runs()
    in_this_process = arm.bus.in_virtual_time
    body = None if used.calibration is None else used.calibration.body
    empty: FollowingRun | None = None
    if in_this_process:
        with bench.session(SessionLoad.UNLOADED) as session:
            empty = runs.plain(session, "empty")
    with bench.session(SessionLoad.LOADED) as session:
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
    return verdict, comparisons


def _require_one_kind(payload: Path | None, expect: str | None) -> None:
    """Refuse both a payload and a range, and neither.

    Raises:
        BadParameter: naming the option.
    """
    if payload is not None and expect is not None:
        raise typer.BadParameter("takes no PAYLOAD: the payload is estimated", param_hint="--expect")
    if payload is None and expect is None:
        raise typer.BadParameter("give a payload file, or --expect with the range of its mass", param_hint="PAYLOAD")


def _declared_mass(arm: Robot, expect: str) -> DeclaredMass:
    """The range of mass that the operator expects.

    Raises:
        BadParameter: the text is not a range.
        AdaptationRefused: the range is empty or too high.
    """
    from armload_controller.feedforward.adaptation_rules import DeclaredMass

    try:
        least_kg, most_kg = (float(part.strip().removesuffix("kg")) for part in expect.split(".."))
    except ValueError:
        raise typer.BadParameter(f"{expect!r}: expected a range such as 0..3", param_hint="--expect") from None
    return DeclaredMass(least_kg, most_kg, arm.rated_payload_kg)


def _adapt(bench: Bench, declared: DeclaredMass, decisions: Path) -> tuple[OffsetVerdict, Sequence[AdaptationDecision]]:
    """The run with torque adapted to the estimate; every decision is shown and logged immediately."""
    from armload_controller.cycle.realtime import running_worker
    from armload_controller.feedforward.adaptation import at_once
    from armload_controller.session.adapted_run import adapted_run
    from armload_controller.session.decision_log import DecisionLog
    from armload_controller.session.run_session import SessionLoad

    arm, display = bench.arm, bench.operator.display
    calibration, _ = bench.used.calibrated("--expect requires a calibrated arm")
    with DecisionLog(decisions, arm.name, display) as log, running_worker("estimate") as executor:
        beside = at_once if arm.bus.in_virtual_time else executor.submit
        with bench.session(SessionLoad.LOADED) as session:
            verdict, made = adapted_run(bench.path, calibration, declared, session, beside, log.report)
    display.step(f"written: {decisions}, {len(made)} decisions")
    return verdict, made
