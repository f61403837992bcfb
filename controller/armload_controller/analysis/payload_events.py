"""What happens to an arm that is watched, from one estimate to the next.

    grasped, dropped        the payload changed, and by how much is known within a quarter of it
    changed tool            it changed, its mass did not, and its centre of mass is elsewhere
    contact                 at rest something pushes harder than friction could hold
    friction drifting       a joint's friction is `DRIFTING` times as far from the calibration's as it was between runs
    calibration out of date `OUTDATED` times as far; or the arm carries less than nothing

Friction and mass are judged after `MOVED_S` of motion, and only what has held for `HELD_S` is an event.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from armload_controller.feedforward.adaptation_rules import friction_change_nm
from armload_identification.calibration.arm_calibration import ArmCalibration
from armload_identification.pipeline.payload_estimator import LivePayload
from armload_identification.verdict.friction_validity import FAR

WEIGHED_WITHIN: Final = 0.25
"""A change of payload is weighed when the half widths of both masses are below this share of it."""
SAME_WITHIN: Final = 0.1
"""A mass is the same after a change when it is, with half widths, within this share of it."""
MOVED_WITHIN_M: Final = 0.01
"""A centre of mass is elsewhere when it is, without its half widths, by more than this."""
DRIFTING: Final = 3.0
"""Standard deviations of the drift between runs."""
OUTDATED: Final = FAR
MOVED_S: Final = 5.0
"""Time in motion from which on friction and a mass below zero are judged."""
HELD_S: Final = 10.0


@dataclass(frozen=True)
class PayloadEvent:
    """Something that happened to the arm.

    Attributes:
        time_s: When, as the recording's stamps have it.
        kind: "changed", as soon as it is noticed; then "grasped", "dropped" or "changed tool", when it is weighed;
            "contact" at rest, and "contact over"; "friction drifting"; "calibration out of date".
        mass_kg: By how much the payload changed; None where that is not known or means nothing.
        joint: Name of the joint whose friction it is about; None for the others.
    """

    time_s: float
    kind: str
    mass_kg: float | None = None
    joint: str | None = None

    def __str__(self) -> str:
        """In a few words."""
        text = self.kind if self.mass_kg is None else f"{self.kind} ({self.mass_kg:+.2f} kg)"
        return text if self.joint is None else f"{text}: {self.joint}"

    def to_dict(self) -> dict[str, Any]:
        """As `armload/watch/1` has it."""
        return {"time_s": self.time_s, "kind": self.kind, "mass_kg": self.mass_kg, "joint": self.joint}


class PayloadEvents:
    """Finds events in the estimates of one arm.

    Args:
        calibration: The arm.
        joint_names: Names of its joints.
    """

    def __init__(self, calibration: ArmCalibration, joint_names: Sequence[str]) -> None:
        self._joint_names = tuple(joint_names)
        self._speed = calibration.middle_speed_rad_s
        self._usual_nm = calibration.usual_change_nm
        self._changes = 0
        self._weighed: LivePayload | None = None
        self._before: LivePayload | None = None
        self._touching = False
        self._since: dict[tuple[str, str | None], float] = {}
        self._said: set[tuple[str, str | None]] = set()

    def of(self, found: LivePayload) -> tuple[PayloadEvent, ...]:
        """What has happened since the estimate before.

        Args:
            found: The estimate of now.
        """
        return (*self._changed(found), *self._contact(found), *self._outdated(found))

    def _changed(self, found: LivePayload) -> list[PayloadEvent]:
        """Another payload: noticed, and weighed as soon as both are known well enough."""
        events = []
        if found.changes > self._changes:
            self._changes = found.changes
            self._before = self._before or self._weighed
            self._weighed = None
            events.append(PayloadEvent(found.changed_s, "changed"))
        if self._before is not None:
            kind = kind_of_change(self._before, found)
            if kind is not None:
                change_kg = None if kind == "changed tool" else found.mass_kg - self._before.mass_kg
                events.append(PayloadEvent(found.changed_s, kind, change_kg))
                self._before = None
        if self._before is None:
            self._weighed = found
        return events

    def _contact(self, found: LivePayload) -> list[PayloadEvent]:
        """A push at rest begins or ends."""
        if found.contact == self._touching:
            return []
        self._touching = found.contact
        return [PayloadEvent(found.time_s, "contact" if found.contact else "contact over")]

    def _outdated(self, found: LivePayload) -> list[PayloadEvent]:
        """What says that the calibration does not hold any more, each thing once."""
        if found.moving_s.max() < MOVED_S:
            self._since.clear()
            return []
        far = friction_change_nm(found, self._speed) / self._usual_nm
        now: set[tuple[str, str | None]] = set()
        for kind, limit in (("friction drifting", DRIFTING), ("calibration out of date", OUTDATED)):
            now |= {(kind, self._joint_names[joint]) for joint in np.flatnonzero(far > limit)}
        if found.mass_kg + found.half_width_95[0] < 0.0:
            now.add(("calibration out of date", None))
        self._since = {what: self._since.get(what, found.time_s) for what in now}
        held = {what for what, since_s in self._since.items() if found.time_s - since_s >= HELD_S}
        fresh = sorted(held - self._said, key=str)
        self._said |= held
        return [PayloadEvent(found.time_s, kind, joint=joint) for kind, joint in fresh]


def kind_of_change(before: LivePayload, after: LivePayload) -> str | None:
    """What a change of payload was; None where one of the two is not known well enough.

    Args:
        before: The payload before the change.
        after: The one after it, as it is known now.
    """
    change = after.mass_kg - before.mass_kg
    doubt = max(after.half_width_95[0], before.half_width_95[0])
    if doubt < WEIGHED_WITHIN * abs(change):
        return "grasped" if change > 0.0 else "dropped"
    both = before.determined[1:] & after.determined[1:]
    apart = np.abs(after.values[1:] - before.values[1:]) - after.half_width_95[1:] - before.half_width_95[1:]
    same = abs(change) + doubt < SAME_WITHIN * before.mass_kg
    return "changed tool" if same and np.any(apart[both] > MOVED_WITHIN_M) else None
