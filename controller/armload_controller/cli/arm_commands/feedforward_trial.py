"""`armload feedforward trial`: whether the drives add the torque that they are sent, at standstill."""

from __future__ import annotations

from functools import partial

from armload_controller.cli.arm_commands.feedforward_bench import (
    BenchOptions,
    PayloadArgument,
    usable,
)
from armload_controller.cli.output.feedforward_output import offset_account


def feedforward_trial(
    options: BenchOptions,
    payload: PayloadArgument,
) -> None:
    """Fade a fifth of the payload's torque in and out at standstill: each drive's response must match the command.

    Nothing moves. With a calibration of the arm, torque is scaled by the calibrated gains.
    """
    from armload_controller.cli.output.json_documents import feedforward_document
    from armload_controller.session.session_load import SessionLoad

    arm = options.movable_arm()
    given = usable(arm, payload)
    with options.bench(arm) as bench:
        with bench.session(SessionLoad.LOADED) as session:
            verdict = bench.runs().try_offset(session, given)
        bench.screen.result(offset_account(verdict))
        bench.screen.document(partial(feedforward_document, arm.name, verdict, (), ()))
