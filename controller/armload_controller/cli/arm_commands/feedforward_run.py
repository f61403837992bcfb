"""`armload feedforward run`: a trajectory with the torque of a payload, given or estimated while the arm moves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.arm_commands.feedforward_bench import Bench, BenchOptions, usable
from armload_controller.cli.options import ends_of
from armload_controller.cli.output.feedforward_output import offset_account

if TYPE_CHECKING:
    from armload_controller.config.robot import Robot
    from armload_controller.feedforward.adaptation import AdaptationDecision
    from armload_controller.feedforward.adaptation_rules import DeclaredMass
    from armload_controller.feedforward.offset_check import OffsetVerdict


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
    from armload_controller.session.session_load import SessionLoad

    require_one_kind(payload, expect)
    arm = options.movable_arm()
    declared = None if expect is None else declared_mass(arm, expect)
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


def require_one_kind(payload: Path | None, expect: str | None) -> None:
    """Refuse both a payload and a range, and neither.

    Raises:
        BadParameter: naming the option.
    """
    if payload is not None and expect is not None:
        raise typer.BadParameter("takes no PAYLOAD: the payload is estimated", param_hint="--expect")
    if payload is None and expect is None:
        raise typer.BadParameter("give a payload file, or --expect with the range of its mass", param_hint="PAYLOAD")


def declared_mass(arm: Robot, expect: str) -> DeclaredMass:
    """The range of mass that the operator expects.

    Raises:
        BadParameter: the text is not a range.
        AdaptationRefused: the range is empty or too high.
    """
    from armload_controller.feedforward.adaptation_rules import DeclaredMass

    ends = ends_of(expect, "kg")
    if len(ends) != 2:
        raise typer.BadParameter(f"{expect!r}: expected a range such as 0..3", param_hint="--expect")
    return DeclaredMass(ends[0], ends[1], arm.rated_payload_kg)


def _adapt(bench: Bench, declared: DeclaredMass, decisions: Path) -> tuple[OffsetVerdict, Sequence[AdaptationDecision]]:
    """The run with torque adapted to the estimate; every decision is shown and logged immediately."""
    from armload_controller.cycle.realtime import running_worker
    from armload_controller.feedforward.adaptation import at_once
    from armload_controller.session.adapted_run import adapted_run
    from armload_controller.session.decision_log import DecisionLog
    from armload_controller.session.session_load import SessionLoad

    arm, display = bench.arm, bench.operator.display
    calibration = bench.used.calibrated("--expect requires a calibrated arm")
    with DecisionLog(decisions, arm.name, display) as log, running_worker("estimate") as executor:
        beside = at_once if arm.bus.in_virtual_time else executor.submit
        with bench.session(SessionLoad.LOADED) as session:
            verdict, made = adapted_run(bench.path, calibration, declared, session, beside, log.report)
    display.step(f"written: {decisions}, {len(made)} decisions")
    return verdict, made
