"""Errors of the servos, divided by who must act.

DriverError
 +-- ServoError            a node violates the standard or its configuration: names node, joint, step
 |    +-- ServoTimeout     ... exceeds a time limit
 |    +-- ServoFault       ... reports a fault itself (statusword FAULT, EMCY)
 |    +-- SdoRefused       ... answered an SDO with an abort code
 |    +-- WrongDevice      ... is not the configured device, or contradicts its configuration
 |    +-- MissingSafety    ... cannot provide a safety property
 |    +-- DriveLeftOp      ... has left OP of EtherCAT by itself
 |    +-- DriveHung        ... exchanges process data, but its firmware hangs
 |    +-- SettingChanged   ... no longer has a value that was read back when it was configured
 |    +-- LoopLost         ... moves its axis otherwise than commanded: encoder, loop or brake has failed
 |    +-- AxisMoves        ... its axis moves without torque: no brake holds it
 |    +-- TorqueRemains    ... may carry torque: its removal could not be read back
 +-- BusError              the bus itself: missing, off, queue full
 |    +-- BusOverload      ... would carry more than its configured share
 |    +-- FramesLost       ... loses too many frames
 |    +-- LinkDown         ... has no link: a cable is unplugged
 |    +-- WorkingCounterWrong     ... carries frames in which not every drive takes part
 +-- ForeignMaster         another master commands the same bus
 +-- LssRefused           a node cannot be given a node id or bit rate
 +-- DescriptionError      a device description (EDS, DCF) that cannot be used
 +-- StateError            the caller requested something that the present state does not allow
 +-- CommandError          ... or a setpoint that cannot be sent to a drive
 +-- StatuswordError       a statusword that matches no state; a ServoError once the node is known
 +-- TransitionError       a CiA 402 goal that is blocked or takes too long; likewise
 +-- SimulationError       the plant cannot be built or has diverged
"""

from __future__ import annotations

from typing import Self


class DriverError(Exception):
    """Root of all errors that `armload_drivers` raises."""


class StateError(DriverError):
    """The caller requested something that the present state does not allow."""


class CommandError(DriverError):
    """A setpoint is not finite or does not fit the object that would carry it."""


class StatuswordError(DriverError):
    """A statusword matches no state of CiA 402."""

    def __init__(self, statusword: int) -> None:
        super().__init__(f"statusword 0x{statusword:04X} matches no state of CiA 402")


class TransitionError(DriverError):
    """A drive cannot reach the requested state, or not in time."""

    def __init__(self, what: str, statusword: int | None) -> None:
        word = "no statusword received" if statusword is None else f"statusword 0x{statusword:04X}"
        super().__init__(f"{what} ({word})")


class BusError(DriverError):
    """The bus itself failed: interface missing, bus-off, queue full."""


class BusOverload(BusError):
    """The configured cycle would load the bus more than the configuration allows."""


class FramesLost(BusError):
    """Too many frames of process data did not return."""


class LinkDown(BusError):
    """The interface has no link."""


class WorkingCounterWrong(BusError):
    """Frames return in which not every drive has taken part, and none says that it has left OP."""


class ForeignMaster(DriverError):
    """Another node sends what only the master of this arm may send."""


class LssRefused(DriverError):
    """A node cannot be given a node id or bit rate by layer setting services."""


class DescriptionError(DriverError):
    """A device description that cannot be used: its file, section and key; both are empty if it is not about one."""

    def __init__(self, source: str, section: str, key: str, what: str) -> None:
        place = f"[{section}]" if section else "the file"
        super().__init__(f"{source}: {place}{' ' + key if key else ''}: {what}")


class SimulationError(DriverError):
    """The simulated plant cannot be built from its specification, or has diverged."""


class ServoError(DriverError):
    """A node violates CiA 301, CiA 402 or its configuration.

    Attributes:
        node_id: CANopen node id.
        joint: Name of the joint the node drives.
        step: The step in progress, as text for the operator.
    """

    def __init__(self, node_id: int, joint: str, step: str, what: str, remedy: str) -> None:
        super().__init__(f"{joint} (node {node_id}), {step}: {what}. {remedy}")
        self.node_id = node_id
        self.joint = joint
        self.step = step


class ServoTimeout(ServoError, TimeoutError):
    """A node did not answer or did not reach a state within its time limit."""


class ServoFault(ServoError):
    """A node reports a fault."""


class SdoRefused(ServoError):
    """A node answered an SDO transfer with an abort code."""

    def __init__(self, node_id: int, joint: str, step: str, what: str, remedy: str, abort_code: int) -> None:
        super().__init__(node_id, joint, step, what, remedy)
        self.abort_code = abort_code


class WrongDevice(ServoError):
    """A node answers, but is not the configured device."""

    @classmethod
    def unnamed(cls, node_id: int, named: int, where: str) -> Self:
        """A drive that the configuration does not name.

        Args:
            node_id: Its node id, or its place in the line.
            named: Number of drives that the configuration names.
            where: "on the bus" or "in the line".
        """
        return cls(
            node_id,
            "no configured joint",
            "looking for other drives",
            f"a CiA 402 drive that the configuration does not name; it names {named}",
            f"Is this the right arm, with all its joints configured? List drives {where} that do not belong to it in "
            "other_nodes",
        )


class MissingSafety(ServoError):
    """A drive cannot provide a safety property, and the configuration does not accept that."""


class DriveLeftOp(ServoError):
    """A drive has left OP of EtherCAT by itself."""


class DriveHung(ServoError):
    """The firmware of a drive hangs: its frames are complete, but it answers nothing."""


class SettingChanged(ServoError):
    """A value that was read back when the drive was configured has changed."""


class LoopLost(ServoError):
    """An axis has left its predicted course: a stop by the drive's own loop cannot be relied on."""


class AxisMoves(ServoError):
    """An axis moves although its drive produces no torque: it has no brake, or its brake does not hold."""


class TorqueRemains(ServoError):
    """It could not be read back that a drive carries no torque."""
