"""Types shared by the tables of a robot's file: numbers with a range, vectors, poses."""

from __future__ import annotations

import math
from typing import Annotated, Final

from pydantic import AfterValidator, Field

from armload_identification.storage.strict_toml import Table

_FULL_TURN_RAD: Final = 2.0 * math.pi
_MOST_TURNS: Final = 4
"""Turns either way from zero that a joint's range may reach; the last joint of some arms has more than one."""
_FASTEST_RAD_S: Final = 50.0
"""Above the speed of every joint of an arm; the slowest speeds given in degrees per second are mostly beyond it."""


def _orientation(angle_rad: float) -> float:
    """An angle of a pose or a kinematic row."""
    if abs(angle_rad) > _FULL_TURN_RAD + 1e-3:
        raise ValueError(
            f"expected radians, at most one turn (6.283) either way; in degrees this would be {_in_rad(angle_rad)} rad"
        )
    return angle_rad


def _joint_position(position_rad: float) -> float:
    """An end of a joint's range."""
    if abs(position_rad) > _MOST_TURNS * _FULL_TURN_RAD:
        raise ValueError(
            f"expected radians, at most {_MOST_TURNS} turns ({_MOST_TURNS * _FULL_TURN_RAD:.1f}) either way; in "
            f"degrees this would be {_in_rad(position_rad)} rad"
        )
    return position_rad


def _joint_speed(speed_rad_s: float) -> float:
    """A joint's greatest speed."""
    if speed_rad_s > _FASTEST_RAD_S:
        raise ValueError(
            f"expected rad/s, at most {_FASTEST_RAD_S:g}; in degrees per second this would be "
            f"{_in_rad(speed_rad_s)} rad/s"
        )
    return speed_rad_s


def _reduction(ratio: float) -> float:
    """A gear ratio of an arm's joint."""
    if ratio < 1.0:
        raise ValueError(
            f"expected motor turns per turn of the joint, at least 1; the inverse of this value is {1.0 / ratio:.5g}"
        )
    return ratio


def _in_rad(angle_deg: float) -> str:
    return f"{math.radians(angle_deg):.5g}"


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Angle = Annotated[float, AfterValidator(_orientation)]
JointPosition = Annotated[float, AfterValidator(_joint_position)]
JointSpeed = Annotated[Positive, AfterValidator(_joint_speed)]
GearRatio = Annotated[Positive, AfterValidator(_reduction)]


class PoseTable(Table):
    """Pose of a frame in another frame."""

    xyz_m: Vector3
    rpy_rad: Annotated[list[Angle], Field(min_length=3, max_length=3)]
