"""`armload feedforward compare`: what the payload's torque does to the following error."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.arm_commands.feedforward_bench import (
    Bench,
    BenchOptions,
    PayloadArgument,
    usable,
)
from armload_controller.cli.output.feedforward_output import offset_account, show_comparisons
from armload_controller.cli.output.output_files import require_folder

if TYPE_CHECKING:
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.session.feedforward_comparison import FollowingComparison
    from armload_identification.model.payload import PayloadResult

IDENTIFIED, IDEAL = "identified payload", "true payload"
FRICTION, ARM = "payload and its friction in the gears", "payload and arm"


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
    require_folder(picture, "picture", "--picture")
    given = usable(arm, payload)
    with options.bench(arm) as bench:
        verdict, comparisons = _compare(bench, given)
        show_comparisons(bench.screen, comparisons, arm.name, picture)
        document = partial(feedforward_document, arm.name, verdict, comparisons, ())
        bench.screen.document(document, {"picture": picture})


def _compare(bench: Bench, payload: PayloadResult) -> tuple[OffsetVerdict, list[FollowingComparison]]:
    """All runs; in simulation also those of the empty arm and of the true payload. The smallest addition is first."""
    import numpy as np

    from armload_controller.feedforward.body_torque import ArmTorque, LoadFriction
    from armload_controller.session.feedforward_comparison import FollowingRun
    from armload_controller.session.session_load import SessionLoad

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
