"""Inspection of drives without a cycle: which are present, and their status. Only reads, also on a bus in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import EffortFeedback, Fieldbus, Identity
from armload_drivers.cia402.drive_safety import Safety, has_a_way
from armload_drivers.cia402.process_data.process_image import effort_entry
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import DriverError


@dataclass(frozen=True, slots=True)
class FoundNode:
    """One node on the bus.

    Attributes:
        device_type: 1000; None if the node refuses the request.
        name: 1008; empty if not reported.
        identity: 1018.
        modes: Numbers of the modes in 6502.
        missing: Names of the safety properties for which the drive has no object.
        twins: Number of further nodes with the same id.
    """

    node_id: int
    device_type: int | None
    name: str
    identity: Identity
    modes: tuple[int, ...]
    missing: tuple[str, ...]
    twins: int = 0

    @property
    def is_drive(self) -> bool:
        """Whether it follows CiA 402."""
        return self.device_type is not None and od.is_drive(self.device_type)


@dataclass(frozen=True, slots=True)
class DriveStatus:
    """Status of one drive.

    Attributes:
        joint: Name of the joint.
        effort_unit: "A" or "N m".
        state: Power state; None if the drive does not answer.
        position_rad: Axis position; None if it or its scale is not reported.
        effort: Motor current or axis torque in `effort_unit`; None if not reported.
        error_code: 603F; None if not reported.
        temperature_celsius: Value of the vendor's object; None if not configured or not reported.
        trouble: Why there is no status; empty if there is.
    """

    joint: str
    node_id: int
    effort_unit: str
    state: State | None = None
    position_rad: float | None = None
    effort: float | None = None
    error_code: int | None = None
    temperature_celsius: float | None = None
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class ArmStatus:
    """Status of an arm and its bus.

    Attributes:
        drives: One entry per joint.
        bus_load: Measured share of the bus, every frame at its worst-case length; None on EtherCAT.
        error_frames: Number of error frames during the measurement.
        error_passive: Whether the controller is error passive.
    """

    drives: tuple[DriveStatus, ...]
    bus_load: float | None
    error_frames: int
    error_passive: bool


def inspect_node(
    sdo: SdoChannel, node_id: int, device_types: Sequence[int | None], fieldbus: Fieldbus = Fieldbus.CANOPEN
) -> FoundNode:
    """What one node reports about itself.

    Args:
        sdo: SDO access to it.
        node_id: Its number.
        device_types: Its 1000 and those of further nodes with the same number; None if the node refuses the request.
        fieldbus: The bus.
    """
    sdo.step = "scanning"
    modes = sdo.read_if_there(od.SUPPORTED_MODES) or 0
    is_there = cache(sdo.has)
    return FoundNode(
        node_id=node_id,
        device_type=device_types[0],
        twins=len(device_types) - 1,
        name=sdo.read_text_if_there(od.DEVICE_NAME),
        identity=Identity(
            sdo.read_if_there(od.VENDOR_ID), sdo.read_if_there(od.PRODUCT_CODE), sdo.read_if_there(od.REVISION)
        ),
        modes=tuple(number + 1 for number in range(32) if modes >> number & 1),
        missing=tuple(of.key for of in Safety if not has_a_way(of, None, is_there, fieldbus)),
    )


def drive_status(setup: DriveSetup, limits: Timeouts) -> DriveStatus:
    """Status of one drive."""
    unit = "A" if setup.settings.feedback is EffortFeedback.CURRENT else "N m"
    status = DriveStatus(setup.settings.joint, setup.settings.node_id, unit)
    try:
        if not setup.is_up():
            return replace(status, trouble=f"no answer within {limits.probe_s} s")
        scale = setup.read_units()
        objects = (od.POSITION_ACTUAL, effort_entry(setup.settings), od.ERROR_CODE)
        position, effort, code = setup.read_values(objects)
        return replace(
            status,
            state=setup.read_state(),
            position_rad=None if position is None else position / scale.counts_per_rad,
            effort=None if effort is None else effort * scale.effort_per_unit,
            error_code=code,
            temperature_celsius=setup.read_temperature_celsius(),
        )
    except DriverError as error:
        return replace(status, trouble=str(error))
