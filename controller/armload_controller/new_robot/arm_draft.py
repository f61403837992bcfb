"""Known data of an arm for its first robot file: kinematics, limits and links, from a URDF or from answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from armload_controller.config.chain_from_urdf import UrdfArm
from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain, rpy_rad
from armload_identification.model.payload import InertialParameters
from armload_identification.storage.toml_text import array, inline


@dataclass(frozen=True, eq=False)
class ArmDraft:
    """An arm of n joints; unknown limits are NaN.

    Attributes:
        name: Name of the robot.
        description: One line that describes it.
        convention: Convention of the kinematics, as in a robot's file.
        rows: TOML of the n rows or origins.
        flange: TOML of the flange's pose in the last joint's frame.
        chain: The same as a chain.
        joint_names: Names from the base to the flange.
        position_min_rad: (n,) lower limit; -inf for a continuous joint.
        position_max_rad: (n,) upper limit; inf for a continuous joint.
        velocity_max_rad_s: (n,) greatest speed.
        torque_max_nm: (n,) greatest torque.
        viscous_nm_s_rad: (n,) viscous friction.
        coulomb_nm: (n,) Coulomb friction.
        links: The body moved by each joint, in its frame; None if unknown.
        other_joints: Joints of the URDF outside the arm, taken as fixed.
        source: Origin of the numbers, for the file's header.
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
    """The arm of a URDF; a limit of zero, which some files use for unspecified limits, counts as unknown.

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
    """The values, with NaN in place of those not above zero."""
    return np.where(values > 0.0, values, np.nan)


def _pose(pose: FloatArray) -> dict[str, str]:
    """A (4, 4) pose as TOML keys and values."""
    return {"xyz_m": array(_rounded(pose[:3, 3])), "rpy_rad": array(_rounded(rpy_rad(pose[:3, :3])))}


def _rounded(values: FloatArray) -> FloatArray:
    """The values without the last digits, which contain only rounding errors."""
    return np.round(values, 12) + 0.0
