"""Events of a watched arm, found by comparing each estimate with the previous one.

    grasped, dropped        the payload's mass changed, and the change is known to within a quarter of its value
    changed tool            the payload changed: same mass, different centre of mass
    something acts          in motion, a torque that neither the payload nor friction explains
    contact                 it was a push; or at rest, an external force exceeds what friction could hold
    friction drifting       a joint's friction differs from the calibration by `DRIFTING` standard deviations
    calibration out of date the same with `OUTDATED` of them; or the estimated mass is below zero
    controller told wrong   the payload that the arm's controller was told is outside the interval of the mass

Friction, a negative mass and what the controller was told are assessed after `MOVED_S` of motion, and count only if
they have persisted for `HELD_S`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_controller.feedforward.adaptation_rules import friction_size
from armload_drivers.listening.overheard_arm import ToldPayload
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.force_watch import ForceEvent, ForceEventKind
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.verdict.decision_levels import ColdArm

WEIGHED_WITHIN: Final = 0.25
"""A change of mass is known if the half widths of the masses before and after are below this share of it."""
SAME_WITHIN: Final = 0.1
"""The mass is unchanged if difference plus half width is below this share of it."""
MOVED_WITHIN_M: Final = 0.01
"""The centre of mass has moved if the difference exceeds the half widths by more than this."""
DRIFTING: Final = 3.0
"""Standard deviations of the drift between runs and of the estimate together."""
FORCE_SIGMAS: Final = 3.0
"""A push has a direction if its force exceeds its standard deviation by this."""
OUTDATED: Final = ColdArm.far_deviations
MOVED_S: Final = 5.0
"""Time in motion after which friction and a mass below zero are assessed."""
HELD_S: Final = 10.0


@dataclass(frozen=True)
class PayloadEvent:
    """An event of the arm.

    Attributes:
        time_s: Time on the clock of the recording's stamps.
        kind: "something acts" as soon as it is noticed in motion; then "changed" if it is another payload, and
            "grasped", "dropped" or "changed tool" once its size is known; "contact" if it is a push, or at rest, and
            "contact over"; "nothing evident" if it is neither; "friction drifting"; "calibration out of date";
            "controller told wrong".
        mass_kg: Change of the payload's mass, or how much more it is than the controller was told; None if unknown or
            not applicable.
        joint: Name of the joint whose friction has changed; None for other events.
        half_width_95_kg: Half width of the 95 % interval of `mass_kg`.
        joints: Names of the joints that show a force; None for other events.
        force_n: Force of a push on the flange, in the base frame; None if it is not determined.
    """

    time_s: float
    kind: str
    mass_kg: float | None = None
    joint: str | None = None
    half_width_95_kg: float | None = None
    joints: tuple[str, ...] | None = None
    force_n: tuple[float, ...] | None = None

    def __str__(self) -> str:
        """One line of text."""
        text = self.kind
        if self.mass_kg is not None:
            width = "" if self.half_width_95_kg is None else f" +- {self.half_width_95_kg:.2f}"
            text += f" ({self.mass_kg:+.2f}{width} kg)"
        if self.force_n is not None:
            text += f" ({np.linalg.norm(self.force_n):.0f} N: {', '.join(f'{each:z.0f}' for each in self.force_n)})"
        named = self.joint or ", ".join(self.joints or ())
        return f"{text}: {named}" if named else text


class PayloadEvents:
    """Finds events in the estimates of one arm."""

    def __init__(self, calibration: ArmCalibration, joint_names: Sequence[str]) -> None:
        self._joint_names = tuple(joint_names)
        self._drift = calibration.drift[:2]
        self._changes = 0
        self._last_weighed: LivePayload | None = None
        self._payload_before: LivePayload | None = None
        self._in_contact = False
        self._present_since_s: dict[tuple[object, ...], float] = {}
        self._reported: set[tuple[object, ...]] = set()

    def of(self, found: LivePayload, told: ToldPayload | None = None) -> tuple[PayloadEvent, ...]:
        """The events since the previous estimate.

        Args:
            found: The estimate.
            told: The payload that the arm's controller was told; None if unknown.
        """
        return (*self._changed(found), *self._contact(found), *self._lasting(found, told))

    def of_forces(self, happened: Sequence[ForceEvent]) -> tuple[PayloadEvent, ...]:
        """Forces in motion; another payload is reported by `of`."""
        events = []
        for each in happened:
            joints = tuple(name for name, shows in zip(self._joint_names, each.joints, strict=True) if shows) or None
            if each.kind is ForceEventKind.ACTING:
                events.append(PayloadEvent(each.time_s, "something acts", joints=joints))
            elif each.kind is ForceEventKind.PUSH and each.assessment is not None:
                found = each.assessment
                known = np.linalg.norm(found.force_n) > FORCE_SIGMAS * np.linalg.norm(found.force_deviation_n)
                force_n = tuple(found.force_n.tolist()) if known else None
                events.append(PayloadEvent(each.since_s, "contact", joints=joints, force_n=force_n))
            elif each.kind is ForceEventKind.NOTHING:
                events.append(PayloadEvent(each.time_s, "nothing evident"))
            elif each.kind is ForceEventKind.OVER:
                events.append(PayloadEvent(each.since_s, "contact over"))
        return tuple(events)

    def _changed(self, found: LivePayload) -> list[PayloadEvent]:
        """A change of payload: when it is detected, and again once both payloads are known well enough."""
        events = []
        if found.changes > self._changes:
            self._changes = found.changes
            self._payload_before = self._payload_before or self._last_weighed
            self._last_weighed = None
            events.append(PayloadEvent(found.changed_s, "changed"))
        if self._payload_before is not None:
            kind = kind_of_change(self._payload_before, found)
            if kind is not None:
                events.append(_weighed(kind, self._payload_before, found))
                self._payload_before = None
        if self._payload_before is None:
            self._last_weighed = found
        return events

    def _contact(self, found: LivePayload) -> list[PayloadEvent]:
        """A push at rest begins or ends."""
        if found.contact == self._in_contact:
            return []
        self._in_contact = found.contact
        return [PayloadEvent(found.time_s, "contact" if found.contact else "contact over")]

    def _lasting(self, found: LivePayload, told: ToldPayload | None) -> list[PayloadEvent]:
        """Signs that calibration or controller state the arm wrongly, each reported once."""
        if found.moving_s.max() < MOVED_S:
            self._present_since_s.clear()
            return []
        far = friction_size(found, self._drift)
        now: dict[tuple[object, ...], PayloadEvent] = {}
        for kind, limit in (("calibration out of date", OUTDATED), ("friction drifting", DRIFTING)):
            for joint in np.flatnonzero(far > limit):
                now[kind, joint] = PayloadEvent(found.time_s, kind, joint=self._joint_names[joint])
        if found.mass_kg + found.half_width_95[0] < 0.0:
            now["negative",] = PayloadEvent(found.time_s, "calibration out of date")
        more_kg = 0.0 if told is None else found.mass_kg - told.mass_kg
        known = found.determined[0] or found.half_width_95[0] < WEIGHED_WITHIN * abs(more_kg)
        if known and abs(more_kg) > found.half_width_95[0]:
            now[found.changes, told] = PayloadEvent(found.time_s, "controller told wrong", more_kg)
        self._present_since_s = {sign: self._present_since_s.get(sign, found.time_s) for sign in now}
        held = {sign for sign, since_s in self._present_since_s.items() if found.time_s - since_s >= HELD_S}
        fresh = [event for sign, event in now.items() if sign in held - self._reported]
        self._reported |= held
        return fresh


def _weighed(kind: str, before: LivePayload, after: LivePayload) -> PayloadEvent:
    """A change of payload with its size."""
    if kind == "changed tool":
        return PayloadEvent(after.changed_s, kind)
    width_kg = float(np.hypot(before.half_width_95[0], after.half_width_95[0]))
    return PayloadEvent(after.changed_s, kind, after.mass_kg - before.mass_kg, half_width_95_kg=width_kg)


def kind_of_change(before: LivePayload, after: LivePayload) -> str | None:
    """Kind of a change of payload; None while either payload is not known well enough."""
    change = after.mass_kg - before.mass_kg
    doubt = max(after.half_width_95[0], before.half_width_95[0])
    if doubt < WEIGHED_WITHIN * abs(change):
        return "grasped" if change > 0.0 else "dropped"
    both = before.determined[1:] & after.determined[1:]
    apart = np.abs(after.values[1:] - before.values[1:]) - after.half_width_95[1:] - before.half_width_95[1:]
    same = abs(change) + doubt < SAME_WITHIN * before.mass_kg
    return "changed tool" if same and np.any(apart[both] > MOVED_WITHIN_M) else None
