"""What can go wrong with the servos, split by who has to act.

DriverError
 +-- ServoError            a node did not do what the standard says: names node, joint, step
 |    +-- ServoTimeout     ... within its time limit
 |    +-- ServoFault       ... and says so itself (statusword FAULT, EMCY)
 |    +-- SdoRefused       ... and answered an SDO with an abort code
 +-- BusError              the bus itself: not there, off, queue full
 +-- WrongDevice           a node is there but is not the configured one
 +-- StateError            our caller asked for something the present state does not allow
 +-- SimulationError       the plant cannot be built or has diverged
"""

from __future__ import annotations


class DriverError(Exception):
    """Root of everything that `armload_drivers` raises."""


class StateError(DriverError):
    """The caller asked for something the present state does not allow."""


class BusError(DriverError):
    """The bus itself failed: interface missing, bus-off, queue full."""


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
    """A node answered an SDO transfer with an abort code."""


class WrongDevice(ServoError):
    """A node answers, but it is not the device the configuration names."""
