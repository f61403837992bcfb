"""What an arm must not touch: the spheres and obstacles of its `[workspace]`, and the meshes of its URDF."""

from __future__ import annotations

from dataclasses import dataclass

from armload_controller.motion.paths import BlockedWay
from armload_core.arrays import FloatArray
from armload_identification.excitation.collision_meshes import Meshes
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.workspace import Workspace


@dataclass(frozen=True, eq=False)
class Cell:
    """Where an arm may be.

    Attributes:
        workspace: Spheres, half-spaces and boxes.
        meshes: Collision geometry, where the file names a URDF.
    """

    workspace: Workspace
    meshes: Meshes | None = None

    def objection(self, path: FourierTrajectory) -> str | None:
        """What a path would touch, or what its meshes come too close to; None where nothing."""
        least = self.workspace.least(path)
        if least.size and least.min() <= 0.0:
            return f"comes within {least.min():.3f} m of {self.workspace.names[int(least.argmin())]!r}"
        return None if self.meshes is None else _told(self.meshes, *self.meshes.nearest(path))

    def require_free(self, start_rad: FloatArray, goal_rad: FloatArray) -> None:
        """Refuse a straight way between two configurations (n,) on which something would be touched.

        Raises:
            BlockedWay: naming it.
        """
        least = self.workspace.least_on_line(start_rad, goal_rad)
        found = None
        if least.size and least.min() <= 0.0:
            found = f"comes within {least.min():.3f} m of {self.workspace.names[int(least.argmin())]!r}"
        elif self.meshes is not None:
            found = _told(self.meshes, *self.meshes.nearest_on_line(start_rad, goal_rad))
        if found is not None:
            raise BlockedWay(f"the straight way {found}")


def _told(meshes: Meshes, distance_m: float, between: str) -> str | None:
    """Meshes that come too close, in words."""
    if distance_m >= meshes.least_m:
        return None
    return f"brings {between} (meshes) within {distance_m:.3f} m of each other, {meshes.keep_m:.3f} are kept"
