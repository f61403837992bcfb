"""An arm's cycles from the frames of its bus, while another master drives it. No bus, clock or thread.

Rules of this file:
- A cycle begins with SYNC: its commands are the last setpoints before that SYNC, its feedback is what the drives send
  after it. It is complete with the last drive's feedback; the next SYNC ends an incomplete one.
- The drives cannot be queried, so scale and mapping are those of the configuration. Polarity (607E) is assumed to be 0.
- There are no cycles until every drive has sent feedback once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, EffortFeedback
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_drivers.cia402.state_machine import State
from armload_drivers.servos import FloatArray, JointCommand, JointFeedback

_ENABLED = State.OPERATION_ENABLED


@dataclass(frozen=True, slots=True)
class ToldPayload:
    """The payload that an arm's controller was told.

    Attributes:
        center_of_mass_m: (x, y, z) in the flange frame.
    """

    mass_kg: float
    center_of_mass_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class OverheardCycle:
    """One cycle of another master.

    Attributes:
        feedback: Feedback of the drives; a joint that is `missing` repeats its last values.
        command: The setpoints before it; None until every drive has been sent one. Its velocity is unknown and set
            to 0.
        enabled: Whether all drives are in OPERATION ENABLED: only then do the motors carry the joints' load.
        lost: Number of whole cycles lost before this one, where that is known.
        told: The payload that the arm's controller was told; None where that is unknown.
        target_torque_nm: (n,) Joint torque that the arm's controller calculated; None where that is unknown.
    """

    feedback: JointFeedback
    command: JointCommand | None
    enabled: bool
    lost: int = 0
    told: ToldPayload | None = None
    target_torque_nm: FloatArray | None = None


class OverheardArm:
    """Assembles an arm's cycles from frames.

    Args:
        arm: The arm; every drive with its scale.

    Attributes:
        syncs: Number of SYNCs received.

    Raises:
        CommandError: a drive's scale is not configured, or the drives report different kinds of effort.
    """

    def __init__(self, arm: ArmSettings) -> None:
        self.syncs = 0
        self._units = ArmUnits(arm)
        self._with_current = self._units.feedback is EffortFeedback.CURRENT
        self._drives = [_HeardDrive(drive) for drive in arm.drives]
        self._routes = {cob_id: drive for drive in self._drives for cob_id in drive.cob_ids}
        self._sync_s: float | None = None
        self._command: JointCommand | None = None

    @property
    def silent(self) -> dict[str, int]:
        """Joints without any feedback, and the number of their feedback frames of another length than configured."""
        return {drive.joint: drive.wrong_length for drive in self._drives if not drive.heard}

    def take(self, cob_id: int, data: bytes, time_s: float) -> OverheardCycle | None:
        """Process one frame.

        Args:
            cob_id: CAN identifier.

        Returns:
            The cycle that it completes or ends; None if it does neither.
        """
        if cob_id == od.SYNC_DEFAULT_COB_ID:
            ended = self._cycle()
            self.syncs += 1
            self._sync_s = time_s
            self._command = self._commanded()
            for drive in self._drives:
                drive.answered.clear()
            return ended
        sender = self._routes.get(cob_id)
        if sender is None or not sender.take(cob_id, data):
            return None
        return self._cycle() if all(drive.complete for drive in self._drives) else None

    def _commanded(self) -> JointCommand | None:
        """The last setpoints sent to the drives."""
        targets = [drive.target for drive in self._drives if drive.target is not None]
        if len(targets) < len(self._drives):
            return None
        return JointCommand(
            self._units.joint_position_rad(targets),
            np.zeros(len(targets)),
            self._units.joint_offset_nm([drive.offset for drive in self._drives]),
        )

    def _cycle(self) -> OverheardCycle | None:
        """The cycle that the last SYNC began, once; None while a drive has never answered."""
        time_s, self._sync_s = self._sync_s, None
        if time_s is None or not all(drive.known for drive in self._drives):
            return None
        effort = [drive.effort for drive in self._drives]
        words = [drive.statusword for drive in self._drives]
        feedback = JointFeedback(
            cycle=self.syncs,
            time_s=time_s,
            position_rad=self._units.joint_position_rad([drive.counts for drive in self._drives]),
            velocity_rad_s=None,
            current_a=self._units.motor_current_a(effort) if self._with_current else None,
            torque_nm=None if self._with_current else self._units.joint_torque_nm(effort),
            statusword=np.array(words, dtype=np.uint16),
            missing=np.array([not drive.complete for drive in self._drives]),
        )
        enabled = all(word & _ENABLED.mask == _ENABLED.bits for word in words)
        return OverheardCycle(feedback, self._command, enabled)


class _HeardDrive:
    """The last values of one drive.

    Attributes:
        cob_ids: COB-IDs of its PDOs.
        answered: COB-IDs of its feedback received since SYNC.
        heard: COB-IDs of its feedback received so far.
        wrong_length: Number of feedback frames with another length than configured.
        target: Setpoint in counts; None before the first.
        offset: Torque offset in per mille.
    """

    def __init__(self, drive: DriveSettings) -> None:
        image = drive_image(drive)
        self.cob_ids = tuple(layout.cob_id for layout in image.layouts)
        self.joint = drive.joint
        self.answered: set[int] = set()
        self.heard: set[int] = set()
        self.wrong_length = self.statusword = self.counts = self.effort = self.offset = 0
        self.target: int | None = None
        self._layouts = {layout.cob_id: (layout.length, layout.unpack) for layout in image.layouts}
        self._image = image
        self._awaited = {layout.cob_id for layout in image.layouts if layout.direction is PdoDirection.TRANSMIT}

    @property
    def complete(self) -> bool:
        """Whether all of its feedback has been received since SYNC."""
        return self.answered == self._awaited

    @property
    def known(self) -> bool:
        """Whether all of its feedback has been received at least once."""
        return self.heard == self._awaited

    def take(self, cob_id: int, data: bytes) -> bool:
        """Process one of its frames; returns whether it is valid feedback."""
        length, unpack = self._layouts[cob_id]
        feedback = cob_id in self._awaited
        if len(data) != length:
            self.wrong_length += feedback
            return False
        values = unpack(data)
        image = self._image
        if cob_id == image.tpdo.cob_id:
            self.statusword, self.counts = values[:2]
            if image.effort is None:
                self.effort = values[2]
        elif cob_id == image.rpdo.cob_id:
            self.target = values[1]
            if len(values) > 2:
                self.offset = values[2]
        elif feedback:
            self.effort = values[0]
        else:
            self.offset = values[0]
        if feedback:
            self.answered.add(cob_id)
            self.heard.add(cob_id)
        return feedback
