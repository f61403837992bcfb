"""The safety properties of `cia402.drive_safety`, written to one drive and read back."""

from __future__ import annotations

from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.cia402.drive_safety import Safety, SafetyFinding, SafetyValues, Way, acceptance, settings_of
from armload_drivers.driver_errors import MissingSafety


def secure(drive: DriveObjects, values: SafetyValues) -> tuple[SafetyFinding, ...]:
    """Provide every property in the first possible way. Nothing is refused here.

    Raises:
        ServoError: the drive does not answer.
    """
    return tuple(_secure_one(drive, of, values) for of in Safety)


def _secure_one(drive: DriveObjects, of: Safety, values: SafetyValues) -> SafetyFinding:
    """Provide one property."""
    drive.sdo.step = f"making sure that the drive {of.title}"
    accepted = of.key in values.drive.accept_missing
    obstacles: list[tuple[str, str]] = []
    for way in of.ways_on(values.arm.fieldbus):
        reason = _secured(drive, way, of, values)
        if not reason:
            return SafetyFinding(of, way, accepted, tuple(obstacles))
        obstacles.append((way.text, reason))
    return SafetyFinding(of, None, accepted, tuple(obstacles))


def _secured(drive: DriveObjects, way: Way, of: Safety, values: SafetyValues) -> str:
    """Try one way; returns why it is not possible, empty if it is."""
    reason = way.condition(values.drive, values.rated_current_a)
    if reason:
        return reason
    settings = settings_of(way, of, values.drive)
    if way.by_vendor and not settings:
        return "the configuration names no manufacturer-specific object (vendor_settings)"
    for setting in settings:
        reason = drive.hold(setting.entry, setting.wanted(values))
        if not reason:
            continue
        drive.miss(setting.entry)
        if not setting.optional:
            return reason
    return ""


def require_safety(drive: DriveObjects, values: SafetyValues, findings: tuple[SafetyFinding, ...]) -> None:
    """Refuse a drive that lacks a safety property, unless the configuration accepts this.

    Raises:
        MissingSafety: naming every such property, its consequence, the remedy, and how to accept it.
    """
    refused = tuple(finding for finding in findings if finding.refused)
    if not refused:
        return
    reasons = "; ".join(f"{finding.of.key}: {finding.of.lost} ({finding.found})" for finding in refused)
    remedies = ". ".join(dict.fromkeys(finding.of.remedy for finding in refused if finding.of.remedy))
    drive.sdo.step = "checking the safety properties"
    raise drive.sdo.failure(
        f"the drive lacks required safety properties: {reasons}",
        f"{remedies}. If the arm stops by other means that you have tested, accept this: "
        f"{acceptance(tuple(finding.of for finding in refused), values.drive)}",
        MissingSafety,
    )
