"""Known data of an arm for its first robot file: kinematics, limits and links, from a URDF or from answers."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from armload_controller.config.chain_from_urdf import DescribedArm, UrdfArm
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import rpy_rad
from armload_identification.storage.toml_text import value


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmDraft(DescribedArm):
    """An arm with its kinematics as text; unknown limits are NaN.

    Attributes:
        description: One line that describes it.
        convention: Convention of the kinematics, as in a robot's file.
        rows: TOML of the n rows or origins.
        flange: TOML of the flange's pose in the last joint's frame.
        source: Origin of the numbers, for the file's header.
    """

    description: str
    convention: str
    rows: tuple[str, ...]
    flange: str
    source: str


def draft_of_urdf(arm: UrdfArm) -> ArmDraft:
    """The arm of a URDF; a limit of zero, which some files use for unspecified limits, counts as unknown."""
    chain = arm.chain
    known: dict[str, Any] = {field.name: getattr(arm, field.name) for field in fields(DescribedArm)}
    known |= {
        name: np.where(known[name] > 0.0, known[name], np.nan) for name in ("velocity_max_rad_s", "torque_max_nm")
    }
    return ArmDraft(
        **known,
        description=f"drafted from {Path(arm.file).name}, {arm.base} to {arm.flange}",
        convention="joint-origins",
        rows=tuple(
            value(_pose(placement) | {"axis": axis})
            for placement, axis in zip(chain.placement, chain.axis, strict=True)
        ),
        flange=value(_pose(chain.flange)),
        source=f"the URDF {Path(arm.file).name}",
    )


def within(draft: ArmDraft, range_rad: FloatArray) -> ArmDraft:
    """The same arm with other ranges.

    Args:
        draft: The arm.
        range_rad: (2, n) least and greatest positions.
    """
    return replace(draft, position_min_rad=range_rad[0], position_max_rad=range_rad[1])


def _pose(pose: FloatArray) -> dict[str, FloatArray]:
    """A (4, 4) pose by TOML key."""
    return {"xyz_m": _rounded(pose[:3, 3]), "rpy_rad": _rounded(rpy_rad(pose[:3, :3]))}


def _rounded(values: FloatArray) -> FloatArray:
    """The values without the last digits, which contain only rounding errors."""
    return np.round(values, 12) + 0.0
