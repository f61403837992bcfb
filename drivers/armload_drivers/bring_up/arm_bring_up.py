"""The drives of one arm before cycles run, on either bus."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.inspection import ArmStatus
from armload_drivers.bring_up.powered_drive import PoweredDrive
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.state_machine import State

LISTEN_S = 1.0
"""How long a status listens to the bus, for a load that means something."""


class ArmBringUp(ABC):
    """Bring-up of the drives of one arm.

    Args:
        setups: Bring-up of each drive.

    Attributes:
        arm: The arm.
        setups: Bring-up of each drive.
    """

    def __init__(self, arm: ArmSettings, setups: Sequence[DriveSetup]) -> None:
        self.arm, self.setups = arm, list(setups)

    @abstractmethod
    def require_no_strangers(self) -> None:
        """Refuse a bus with a drive that the configuration does not name. Only reads.

        Raises:
            WrongDevice: naming the drive.
            BusError: the bus failed.
        """

    @abstractmethod
    def powered_drives(self, setups: Sequence[DriveSetup]) -> list[PoweredDrive]:
        """Drives that carry torque. Only reads.

        Args:
            setups: Drives of the arm that answer.

        Raises:
            ServoError: a drive does not report its state, position or scale.
            BusError: the bus failed.
        """

    @abstractmethod
    def restart(self, setups: Sequence[DriveSetup]) -> list[DriveSetup]:
        """Put drives that carry no torque in the state in which they are configured.

        Returns:
            Drives that did not report this.

        Raises:
            BusError: the bus failed.
        """

    @abstractmethod
    def status(self, listen_s: float) -> ArmStatus:
        """Status of the drives. Only reads, over CANopen also while another program moves the arm.

        Args:
            listen_s: Time to listen to the bus before.

        Raises:
            BusError: the bus failed.
        """

    def reset_fault(self, setup: DriveSetup) -> State:
        """Reset the fault of one drive; its state afterwards. Raises as `SdoRequests.reset_fault`."""
        return setup.reset_fault()
