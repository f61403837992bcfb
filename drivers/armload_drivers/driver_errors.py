"""What can go wrong with the servos, split by who must act.

DriverError
 +-- ServoError            a node did not do what the standard says: names node, joint, step
 |    +-- ServoTimeout     ... within its time limit
 |    +-- ServoFault       ... and says so itself (statusword FAULT, EMCY)
 |    +-- SdoRefused       ... and answered an SDO with an abort code
 |    +-- WrongDevice      ... but is not the configured device, or contradicts its configuration
 |    +-- MissingSafety    ... because it has no way to a property that safety rests on
 |    +-- AxisMoves        ... and its axis moves without torque: no brake holds it
 +-- BusError              the bus itself: not there, off, queue full
 |    +-- BusOverload      ... would carry more than its configured share
 +-- ForeignMaster         another master commands the same bus
 +-- DescriptionError      a device description (EDS, DCF) that cannot be used
 +-- StateError            our caller asked for something the present state does not allow
 +-- CommandError          ... or for a setpoint that no drive can be sent
 +-- StatuswordError       a statusword that matches no state; ServoError where the node is known
 +-- TransitionError       a CiA 402 goal that is blocked or takes too long; likewise
 +-- SimulationError       the plant cannot be built or has diverged
"""

from __future__ import annotations


class DriverError(Exception):
    """Root of everything that `armload_drivers` raises."""


class StateError(DriverError):
    """The caller asked for something the present state does not allow."""


class CommandError(DriverError):
    """A setpoint is not finite or does not fit the object that would carry it."""


class StatuswordError(DriverError):
    """A statusword matches no state of CiA 402.

    Attributes:
        statusword: The word received.
    """

    def __init__(self, statusword: int) -> None:
        super().__init__(f"statusword 0x{statusword:04X} matches no state of CiA 402")
        self.statusword = statusword


class TransitionError(DriverError):
    """A drive cannot reach the state that was asked for, or not in time.

    Attributes:
        statusword: The last word received, None where there was none.
    """

    def __init__(self, what: str, statusword: int | None) -> None:
        word = "no statusword received" if statusword is None else f"statusword 0x{statusword:04X}"
        super().__init__(f"{what} ({word})")
        self.statusword = statusword


class BusError(DriverError):
    """The bus itself failed: interface missing, bus-off, queue full."""


class BusOverload(BusError):
    """The configured cycle would load the bus more than the configuration allows."""


class ForeignMaster(DriverError):
    """Another node sends what only the master of this arm may send."""


class DescriptionError(DriverError):
    """A device description that cannot be used.

    Attributes:
        source: Name of the file.
        section: Section of it; empty where the file as a whole is meant.
        key: Key; empty where the section as a whole is meant.
    """

    def __init__(self, source: str, section: str, key: str, what: str) -> None:
        place = f"[{section}]" if section else "the file"
        super().__init__(f"{source}: {place}{' ' + key if key else ''}: {what}")
        self.source = source
        self.section = section
        self.key = key


class SimulationError(DriverError):
    """The simulated plant cannot be built from its specification, or has diverged."""


class ServoError(DriverError):
    """A node did not do what CiA 301 or CiA 402 asks of it.

    Attributes:
        node_id: CANopen node id.
        joint: Name of the joint the node drives.
        step: What was being done, in the operator's words.
    """

    def __init__(self, node_id: int, joint: str, step: str, what: str, remedy: str) -> None:
        super().__init__(f"{joint} (node {node_id}), {step}: {what}. {remedy}")
        self.node_id = node_id
        self.joint = joint
        self.step = step


class ServoTimeout(ServoError, TimeoutError):
    """A node did not answer or did not reach a state within its time limit."""


class ServoFault(ServoError):
    """A node reports a fault of its own."""


class SdoRefused(ServoError):
    """A node answered an SDO transfer with an abort code.

    Attributes:
        abort_code: The code.
    """

    def __init__(self, node_id: int, joint: str, step: str, what: str, remedy: str, abort_code: int) -> None:
        super().__init__(node_id, joint, step, what, remedy)
        self.abort_code = abort_code


class WrongDevice(ServoError):
    """A node answers, but it is not the device the configuration names."""


class MissingSafety(ServoError):
    """A drive has no way to a property that safety rests on, and the configuration does not accept that."""


class AxisMoves(ServoError):
    """An axis moves although its drive gives no torque any more: it has no brake, or its brake does not hold."""
