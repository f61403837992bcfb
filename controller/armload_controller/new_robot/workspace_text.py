"""`[workspace]` of a first robot file: spheres, meshes and a floor, and what they leave unchecked."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from armload_controller.new_robot.arm_draft import ArmDraft
from armload_controller.new_robot.drafted_file import DraftedFile
from armload_controller.new_robot.workspace_draft import BARE_RADIUS_M, KEEP_M, WorkspaceDraft, up_of
from armload_identification.storage.toml_text import inline, value


def add_workspace(file: DraftedFile, arm: ArmDraft, workspace: WorkspaceDraft) -> None:
    """Add `[workspace]`, and say what it does not contain."""
    names = [str(index) for index in range(arm.n + 1)] + ['"tool"']
    _add_table(file, arm, workspace, names)
    file.unchecked += _unchecked(workspace, names)


def _add_table(file: DraftedFile, arm: ArmDraft, workspace: WorkspaceDraft, names: list[str]) -> None:
    """The table; `names` of the links in TOML, from the base to the tool."""
    file.add(
        "# What the arm must not touch. Spheres in the joint frames (0: base); the tool's in the flange frame.",
        "[workspace]",
        f"keep_m = {value(KEEP_M)}  # assumed: clearance to everything",
        "spheres = [",
    )
    for sphere in workspace.spheres:
        why = (
            "  # assumed"
            if sphere.link == len(names) - 1
            else "  # assumed: no geometry known"
            if sphere.link in workspace.bare
            else ""
        )
        row = {
            "link": names[sphere.link],
            "center_m": value(np.round(sphere.center_m, 4) + 0.0),
            "radius_m": value(round(sphere.radius_m, 4)),
        }
        file.add(f"    {inline(row)},{why}")
    file.add("]")
    if workspace.apart:
        file.add("apart = [", *(f"    [{names[a]}, {names[b]}]," for a, b in workspace.apart), "]")
    if workspace.urdf is not None and workspace.meshes:
        file.add(f"urdf = {value(workspace.urdf)}  # its meshes are also checked")
        if workspace.touching:
            file.add(
                "urdf_touching = [  # neighbours whose shapes touch in nearly every pose",
                *(f"    [{value(a)}, {value(b)}]," for a, b in workspace.touching),
                "]",
            )
    if workspace.above_floor:
        row = {
            "name": '"floor"',
            "normal": value(np.round(up_of(arm), 9) + 0.0),
            "offset_m": value(round(workspace.floor_m, 4) + 0.0),
            "links": "[" + ", ".join(names[index] for index in workspace.above_floor) + "]",
        }
        file.add("half_spaces = [", f"    {inline(row)},  # assumed: at the height of the root", "]")
    file.add("")


def _unchecked(workspace: WorkspaceDraft, names: list[str]) -> Iterator[str]:
    """What the table leaves unchecked, one sentence each."""
    yield "surroundings: only a floor at the height of the root; add tables, walls, fences"
    low = [name for index, name in enumerate(names[:-1]) if index and index not in workspace.above_floor]
    if low:
        yield f"link {', '.join(low)}: not kept above that floor, which its spheres reach in most poses"
    if workspace.bare:
        numbers = ", ".join(map(str, workspace.bare))
        yield f"shape of link {numbers}: a sphere of {BARE_RADIUS_M:g} m around its origin"
    if workspace.overlapping and not workspace.meshes:
        pairs = ", ".join(f"{names[a]} and {names[b]}" for a, b in workspace.overlapping)
        yield f"pairs of links not checked for collision, because their spheres overlap in most poses: {pairs}"
    if workspace.meshes and workspace.touching:
        pairs = ", ".join(f"{a} and {b}" for a, b in workspace.touching)
        yield f"pairs of meshes that may touch, because their convex hulls do in most poses: {pairs}"
    if workspace.why_no_meshes:
        yield f"meshes are not checked: {workspace.why_no_meshes}"
