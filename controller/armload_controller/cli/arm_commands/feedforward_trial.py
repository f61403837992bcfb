"""`armload feedforward trial`: whether the drives add the torque that they are sent, at standstill."""

from __future__ import annotations

from functools import partial

from armload_controller.cli.arm_commands.feedforward_bench import (
    BenchOptions,
    ExcitationOption,
    PayloadArgument,
    usable,
)
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
from armload_controller.cli.output.feedforward_output import offset_account
from armload_controller.cli.output.json_output import JsonOption


def feedforward_trial(
    robot: RobotArgument,
    payload: PayloadArgument,
    excitation: ExcitationOption = None,
    calibration: CalibrationOption = None,
    mounted: MountedOption = None,
    bus: BusOption = None,
    bitrate: BitrateOption = None,
    cycle_hz: CycleOption = None,
    simulated_drives: SimulatedDrivesOption = False,
    yes: YesOption = False,
    live: LiveOption = False,
    live_address: LiveAddressOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fade a fifth of the payload's torque in and out at standstill: each drive's response must match the command.

    Nothing moves. With a calibration of the arm, torque is scaled by the calibrated gains.
    """
    from armload_controller.cli.output.result_documents import feedforward_document
    from armload_controller.session.run_session import Load

    options = BenchOptions(
        robot,
        bus,
        bitrate,
        cycle_hz,
        simulated_drives,
        mounted,
        excitation,
        calibration,
        yes,
        live,
        live_address,
        as_json,
    )
    arm = options.arm()
    given = usable(arm, payload)
    with options.bench(arm) as bench:
        with bench.session(Load.LOADED) as session:
            verdict = bench.runs().try_offset(session, given)
        bench.screen.result(offset_account(verdict))
        bench.screen.document(partial(feedforward_document, arm.name, verdict, (), ()))
