"""Tables of `armload drives`: nodes, the steps of a check, and the state of the drives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Column, Table
from rich.text import Text

from armload_controller.session.brake_test import BrakeFinding
from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.drive_check import Check
from armload_drivers.bring_up.inspection import ArmStatus, FoundNode
from armload_drivers.cia402.drive_safety import SafetyFinding
from armload_drivers.cia402.emergency import error_text

MODE_NAMES = {1: "PP", 3: "PV", 4: "PT", 6: "HM", 7: "IP", 8: "CSP", 9: "CSV", 10: "CST"}
_SAFETY_COLOURS = {"missing": "red", "accepted": "yellow", "ok": "green"}
_COLOURS = {"wrong": "red", "not done": "dim", "missing": "yellow", "ok": "green"}
"""Of every verdict, in the order of the rows."""


def found_table(found: list[FoundNode]) -> Table:
    """One row per node."""
    headings = ("node", "device", "vendor", "product", "revision", "modes", "missing safety properties")
    table = Table(*headings, title="nodes on the bus")
    for node in found:
        kind = node.name or "CiA 402 drive"
        if not node.is_drive:
            kind = f"{node.name or 'unnamed'}, not a CiA 402 drive: device type {_hexadecimal(node.device_type)}"
        if node.twins:
            kind += f"; {node.twins + 1} nodes have this id: give each its own"
        identity = node.identity
        numbers = (identity.vendor_id, identity.product_code, identity.revision)
        modes = " ".join(MODE_NAMES.get(mode, str(mode)) for mode in node.modes)
        lacks = " ".join(node.missing) if node.is_drive else "-"
        table.add_row(str(node.node_id), kind, *(_hexadecimal(number) for number in numbers), modes, lacks or "nothing")
    return table


def _hexadecimal(number: int | None) -> str:
    """A number of 1018."""
    return "-" if number is None else f"0x{number:08X}"


def _folded(*headings: str) -> list[Column]:
    """Columns of texts that may contain long words."""
    return [Column(heading, overflow="fold") for heading in headings]


def check_table(rows: Sequence[Check]) -> Table:
    """One row per step and result, for all joints that have it; what is not ok first."""
    found = [((row.step, row.verdict.value, row.detail), f"{row.joint} ({row.node_id})") for row in rows]
    return _grouped_table("bring-up short of enabling", ("step", "what"), found, _COLOURS)


def safety_table(drives: Sequence[DriveSetup]) -> Table:
    """One row per property and how it is provided, or the consequence of its absence and the remedy; these first."""
    found = [
        ((finding.of.title, *_safety_cells(finding)), f"{drive.settings.joint} ({drive.settings.node_id})")
        for drive in drives
        for finding in drive.safety
    ]
    return _grouped_table("safety properties of the drives", ("the drive ...", "by"), found, _SAFETY_COLOURS)


def _grouped_table(
    title: str, headings: tuple[str, str], found: Sequence[tuple[tuple[str, str, str], str]], colours: Mapping[str, str]
) -> Table:
    """One row for equal cells, with all their joints; the second cell is a verdict, and orders the rows."""
    joints: dict[tuple[str, str, str], list[str]] = {}
    for cells, joint in found:
        joints.setdefault(cells, []).append(joint)
    count, order = len({joint for _, joint in found}), list(colours)
    table = Table(*_folded("joint (node)", headings[0], "", headings[1]), title=title)
    for (what, verdict, detail), names in sorted(joints.items(), key=lambda entry: order.index(entry[0][1])):
        shown = f"all {count}" if len(names) == count > 1 else ", ".join(names)
        table.add_row(shown, what, Text(verdict, style=colours[verdict]), detail)
    return table


def _safety_cells(finding: SafetyFinding) -> tuple[str, str]:
    """Verdict and explanation of one property."""
    if finding.way is not None:
        return "ok", f"{finding.way.text}: {finding.way.verified}"
    what = f"{finding.found}. Consequence: {finding.of.lost}. {finding.of.remedy}"
    if finding.accepted:
        return "accepted", what
    return "missing", f'{what}. Then name "{finding.of.key}" in accept_missing'


def brake_table(found: Sequence[BrakeFinding]) -> Table:
    """One row per joint: whether its brake holds."""
    table = Table(*_folded("joint", "torque N m", "shown by the motor", "moved rad", "brake"), title="brakes")
    for finding in found:
        if not finding.tried_nm:
            table.add_row(finding.joint, "", "", "", Text("not tried: no brake, or no 60B2", style="yellow"))
            continue
        verdict = Text("holds", style="green") if finding.holds else Text("does not hold", style="red")
        share, moved = f"{100.0 * finding.response:.0f} %", f"{finding.moved_rad:.4f}"
        table.add_row(finding.joint, f"{finding.tried_nm:.1f}", share, moved, verdict)
    return table


def status_table(status: ArmStatus) -> Table:
    """One row per joint."""
    warm = any(drive.temperature_celsius is not None for drive in status.drives)
    headings = ("node", "state", "axis position rad", "effort", *["°C"] * warm, "error")
    table = Table("joint", *headings)
    for drive in status.drives:
        if drive.state is None:
            table.add_row(drive.joint, str(drive.node_id), "?", "", "", *[""] * warm, drive.trouble)
            continue
        position = "-" if drive.position_rad is None else f"{drive.position_rad:+z.5f}"
        effort = "-" if drive.effort is None else f"{drive.effort:+z.3f} {drive.effort_unit}"
        error = "-" if drive.error_code is None else error_text(drive.error_code)
        celsius = "-" if drive.temperature_celsius is None else f"{drive.temperature_celsius:.0f}"
        table.add_row(drive.joint, str(drive.node_id), drive.state.title, position, effort, *[celsius] * warm, error)
    return table


def bus_line(status: ArmStatus) -> str:
    """State of the bus in one line."""
    if status.bus_load is None:
        return "EtherCAT: drives in PREOP, no process data"
    passive = ", error passive" if status.error_passive else ""
    return f"bus load {100.0 * status.bus_load:.1f} %, {status.error_frames} error frames{passive}"
