"""Results of commands as documents for `--json`; `json_schemas.json` describes them.

A missing number is None, and so is one that is not finite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from armload_identification.results.findings_document import json_number
from armload_identification.results.json_document import json_document

if TYPE_CHECKING:
    # a command does not load the modules of the other documents
    from armload_controller.analysis.robot_export import Exported
    from armload_controller.feedforward.adaptation import AdaptationDecision
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.new_robot.arm_draft import ArmDraft
    from armload_controller.new_robot.drafted_file import DraftedFile
    from armload_controller.session.brake_test import BrakeFinding
    from armload_controller.session.feedforward_comparison import FollowingComparison
    from armload_drivers.bring_up.drive_check import ArmCheck
    from armload_drivers.bring_up.inspection import ArmStatus, DriveStatus, FoundNode


def nodes_document(interface: str, channel: str, found: Sequence[FoundNode]) -> dict[str, Any]:
    """Nodes that answer on a bus."""

    def node_fields(node: FoundNode) -> dict[str, Any]:
        lists = {"modes": list(node.modes), "missing": list(node.missing)}
        fields = asdict(node) | asdict(node.identity) | lists | {"is_drive": node.is_drive}
        return {key: value for key, value in fields.items() if key not in {"identity", "device_type"}}

    nodes = [node_fields(node) for node in found]
    return json_document("nodes", {"interface": interface, "channel": channel, "nodes": nodes})


def checks_document(robot: str, found: ArmCheck, tried: Sequence[BrakeFinding] = ()) -> dict[str, Any]:
    """The steps of a bring-up short of enabling, the safety properties, and the brakes if they were tried."""
    checks = [asdict(row) | {"verdict": row.verdict.value} for row in found.steps]
    safety = [
        {
            "joint": drive.settings.joint,
            "node_id": drive.settings.node_id,
            "properties": [
                {
                    "property": finding.of.key,
                    "title": finding.of.title,
                    "way": finding.way and finding.way.text,
                    "verified": finding.way and finding.way.verified,
                    "accepted": finding.accepted,
                    "refused": finding.refused,
                    "obstacles": [{"way": way, "reason": reason} for way, reason in finding.obstacles],
                    "lost": finding.of.lost,
                    "remedy": finding.of.remedy,
                }
                for finding in drive.safety
            ],
        }
        for drive in found.secured
    ]
    brakes = [asdict(finding) | {"holds": finding.holds} for finding in tried]
    return json_document("checks", {"robot": robot, "checks": checks, "safety": safety, "brakes": brakes})


def status_document(robot: str, status: ArmStatus) -> dict[str, Any]:
    """The state of an arm's drives."""

    def drive_fields(drive: DriveStatus) -> dict[str, Any]:
        fields = asdict(drive)
        state = None if drive.state is None else drive.state.title
        return {"axis_position_rad": fields.pop("position_rad"), **fields, "state": state}

    bus = {"bus_load": status.bus_load, "error_frames": status.error_frames, "error_passive": status.error_passive}
    return json_document("status", {"robot": robot, "drives": [drive_fields(each) for each in status.drives], **bus})


def feedforward_document(
    robot: str,
    verdict: OffsetVerdict,
    comparisons: Sequence[FollowingComparison],
    decisions: Sequence[AdaptationDecision] = (),
) -> dict[str, Any]:
    """The drives' response to a torque offset, the following errors without and with it, and the decisions."""
    offset = [
        {"name": name, "gain": float(gain) if usable else None, "usable": bool(usable)}
        for name, gain, usable in zip(verdict.joint_names, verdict.gain, verdict.usable, strict=True)
    ]
    compared = [
        {
            "measure": str(comparison.measure),
            "joints": [
                {
                    "name": name,
                    "weight_nm": float(comparison.weight_nm[i]),
                    "carries_weight": i in comparison.gravity_loaded,
                    "without_rms_rad": float(comparison.without_rms_rad[i]),
                    "reduction": {label: json_number(comparison.reduction(label)[i]) for label in comparison.with_rad},
                }
                for i, name in enumerate(comparison.joint_names)
            ],
        }
        for comparison in comparisons
    ]
    made = [decision.to_dict() for decision in decisions]
    return json_document("feedforward", {"robot": robot, "offset": offset, "comparisons": compared, "decisions": made})


def init_document(arm: ArmDraft, drafted: DraftedFile, problem: str | None, following: str) -> dict[str, Any]:
    """A first robot file, with its missing and assumed values."""
    of_arm = {"robot": arm.name, "joint_names": list(arm.joint_names), "other_joints": list(arm.other_joints)}
    of_file = {"holes": list(drafted.holes), "assumed": list(drafted.unchecked)}
    return json_document("init", of_arm | of_file | {"no_excitation": problem, "next": following})


def export_document(done: Exported) -> dict[str, Any]:
    """The files of an export."""
    files = [{"path": str(path), "written": new} for path, new in done.files.items()]
    return json_document(
        "export", {"robot": done.robot, "format": done.export_format, "files": files, "notes": list(done.notes)}
    )
