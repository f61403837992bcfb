"""What an arm must not touch: the obstacles of its `[workspace]`, and the meshes of its URDF."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.float_array import FloatArray

if TYPE_CHECKING:
    from armload_controller.motion.collision_meshes import Meshes


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Collision model of an arm and its surroundings.

    Attributes:
        workspace: Spheres, half-spaces and boxes.
        meshes: Collision geometry; None if the file names no URDF.
    """

    workspace: Workspace
    meshes: Meshes | None = None

    def objection(self, path: FourierTrajectory) -> str | None:
        """What a path would touch, or which meshes come too close, also between samples; None if nothing."""
        return self._touched(self.workspace.least(path)) or (
            None if self.meshes is None else _too_close(self.meshes, *self.meshes.nearest(path))
        )

    def objection_on_line(self, start_rad: FloatArray, goal_rad: FloatArray) -> str | None:
        """As `objection`, for the straight line between two configurations (n,)."""
        return self._touched(self.workspace.least_on_line(start_rad, goal_rad)) or (
            None if self.meshes is None else _too_close(self.meshes, *self.meshes.nearest_on_line(start_rad, goal_rad))
        )

    def _touched(self, clearance_m: FloatArray) -> str | None:
        """Description of the obstacle with the least of K clearances (K,), if zero or less; otherwise None."""
        if not clearance_m.size or clearance_m.min() > 0.0:
            return None
        part, other = self.workspace.between[int(clearance_m.argmin())]
        return f"brings {part} within {clearance_m.min():.3f} m of {other}"


def _too_close(meshes: Meshes, distance_m: float, between: str) -> str | None:
    """Description of meshes that come too close; otherwise None."""
    if distance_m >= meshes.least_m:
        return None
    return f"brings {between} (meshes) within {distance_m:.3f} m of each other, {meshes.keep_m:.3f} m is required"
