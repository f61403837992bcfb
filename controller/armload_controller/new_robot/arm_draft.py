"""What is known of an arm that gets its first robot file: kinematics, limits and links, from a URDF or from answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armload_controller.config.urdf_arm import UrdfArm
from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain, rpy_rad
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.toml_text import array, inline


@dataclass(frozen=True, eq=False)
class ArmDraft:
    """An arm of n joints; NaN where a limit is not known.

    Attributes:
        name: Of the robot.
        description: What it is, in a line.
        convention: Of the kinematics, as in a robot's file.
        rows: (n) TOML of each row or origin.
        flange: TOML of the flange's pose in the last joint's frame.
        chain: The same as a chain.
        joint_names: From the base to the flange.
        position_min_rad: (n,) -inf where a joint turns without end.
        position_max_rad: (n,) inf likewise.
        velocity_max_rad_s: (n,) greatest speed.
        torque_max_nm: (n,) greatest torque.
        viscous_nm_s_rad: (n,) friction per speed.
        coulomb_nm: (n,) friction at any speed.
        links: What turns with each joint, in its frame; None where it is not known.
        other_joints: Of the URDF, not the arm's; they are taken as fixed.
        source: What the numbers come from.
    """

    name: str
    description: str
    convention: str
    rows: tuple[str, ...]
    flange: str
    chain: Chain
    joint_names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    torque_max_nm: FloatArray
    viscous_nm_s_rad: FloatArray
    coulomb_nm: FloatArray
    links: tuple[InertialParameters | None, ...]
    other_joints: tuple[str, ...]
    source: str

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)


def draft_of_urdf(arm: UrdfArm) -> ArmDraft:
    """The arm of a URDF; a limit of zero, as some files have for what they leave open, is not known.

    Args:
        arm: The arm.
    """
    chain = arm.chain
    positive = {name: _positive(getattr(arm, name)) for name in ("velocity_max_rad_s", "torque_max_nm")}
    lower, upper = arm.position_min_rad, arm.position_max_rad
    no_range = ~(lower < upper)
    return ArmDraft(
        name=arm.name,
        description=f"drafted from {Path(arm.file).name}, {arm.base} to {arm.flange}",
        convention="joint-origins",
        rows=tuple(
            inline(_pose(placement) | {"axis": array(axis)})
            for placement, axis in zip(chain.placement, chain.axis, strict=True)
        ),
        flange=inline(_pose(chain.flange)),
        chain=chain,
        joint_names=arm.joint_names,
        position_min_rad=np.where(no_range, np.nan, lower),
        position_max_rad=np.where(no_range, np.nan, upper),
        velocity_max_rad_s=positive["velocity_max_rad_s"],
        torque_max_nm=positive["torque_max_nm"],
        viscous_nm_s_rad=arm.viscous_nm_s_rad,
        coulomb_nm=arm.coulomb_nm,
        links=arm.links,
        other_joints=tuple(arm.other_joints),
        source=f"the URDF {Path(arm.file).name}",
    )


def named(draft: ArmDraft, name: str | None) -> ArmDraft:
    """The same arm under another name."""
    return draft if name is None else replace(draft, name=name)


def within(draft: ArmDraft, range_rad: FloatArray) -> ArmDraft:
    """The same arm with other ranges.

    Args:
        draft: The arm.
        range_rad: (2, n) least and greatest positions.
    """
    return replace(draft, position_min_rad=range_rad[0], position_max_rad=range_rad[1])


def _positive(values: FloatArray) -> FloatArray:
    """NaN for what is not above zero."""
    return np.where(values > 0.0, values, np.nan)


def _pose(pose: FloatArray) -> dict[str, str]:
    """A (4, 4) pose as keys and values of TOML."""
    return {"xyz_m": array(_rounded(pose[:3, 3])), "rpy_rad": array(_rounded(rpy_rad(pose[:3, :3])))}


def _rounded(values: FloatArray) -> FloatArray:
    """Without the last digits, in which only the arithmetic shows."""
    return np.round(values, 12) + 0.0
