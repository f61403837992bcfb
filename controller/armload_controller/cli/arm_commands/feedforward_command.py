"""`armload feedforward`: the payload's torque in the drives (60B2)."""

from __future__ import annotations

from armload_controller.cli.arm_commands.feedforward_compare import feedforward_compare
from armload_controller.cli.arm_commands.feedforward_run import feedforward_run
from armload_controller.cli.arm_commands.feedforward_trial import feedforward_trial
from armload_controller.cli.command_group import Commands

feedforward = Commands(
    "Add a payload's torque to that of the drives (60B2), which is tried at standstill before anything moves."
)
feedforward.command("trial")(feedforward_trial)
feedforward.command("compare")(feedforward_compare)
feedforward.command("run")(feedforward_run)
