"""Types shared by the tables of a robot's file: numbers with a range, vectors, poses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Final

from msgspec import Meta

from armload_identification.storage.strict_toml import Table

_FULL_TURN_RAD: Final = 2.0 * math.pi
_MOST_TURNS: Final = 4
"""Turns either way from zero that a joint's range may reach; the last joint of some arms has more than one."""
_FASTEST_RAD_S: Final = 50.0
"""Above the speed of every joint of an arm; the slowest speeds given in degrees per second are mostly beyond it."""
_STRONGEST_KG: Final = 2500.0
"""Above the rated payload of every arm (FANUC M-2000iA/2300: 2300 kg); most payloads given in grams are beyond it."""


def _orientation(angle_rad: float) -> str:
    """What an angle of a pose or a kinematic row must be."""
    return f"expected radians, at most one turn (6.283) either way; in degrees this would be {_in_rad(angle_rad)} rad"


def _joint_position(position_rad: float) -> str:
    """What an end of a joint's range must be."""
    return (
        f"expected radians, at most {_MOST_TURNS} turns ({_MOST_TURNS * _FULL_TURN_RAD:.1f}) either way; in "
        f"degrees this would be {_in_rad(position_rad)} rad"
    )


def _joint_speed(speed_rad_s: float) -> str:
    """What a joint's greatest speed must be."""
    return (
        f"expected rad/s, at most {_FASTEST_RAD_S:g}; in degrees per second this would be {_in_rad(speed_rad_s)} rad/s"
    )


def _rated_mass(mass_kg: float) -> str:
    """What an arm's rated payload must be."""
    return f"expected kg, at most {_STRONGEST_KG:g}; in grams this would be {mass_kg / 1e3:.5g} kg"


def _reduction(ratio: float) -> str:
    """What a gear ratio of an arm's joint must be."""
    expected = "expected motor turns per turn of the joint, at least 1"
    return f"{expected}; the inverse of this value is {1.0 / ratio:.5g}" if ratio > 0.0 else expected


def _in_rad(angle_deg: float) -> str:
    return f"{math.radians(angle_deg):.5g}"


def _limited(limit: float, expected: Callable[[float], str]) -> Meta:
    """A range of either sign, and what to say about a value outside."""
    return Meta(ge=-limit, le=limit, extra={"expected": expected})


Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Share = Annotated[float, Meta(ge=0, lt=1)]
Vector3 = Annotated[list[float], Meta(min_length=3, max_length=3)]
Angle = Annotated[float, _limited(_FULL_TURN_RAD + 1e-3, _orientation)]
JointPosition = Annotated[float, _limited(_MOST_TURNS * _FULL_TURN_RAD, _joint_position)]
JointSpeed = Annotated[Positive, Meta(le=_FASTEST_RAD_S, extra={"expected": _joint_speed})]
RatedMass = Annotated[Positive, Meta(le=_STRONGEST_KG, extra={"expected": _rated_mass})]
GearRatio = Annotated[float, Meta(ge=1, extra={"expected": _reduction})]


class PoseTable(Table):
    """Pose of a frame in another frame."""

    xyz_m: Vector3
    rpy_rad: Annotated[list[Angle], Meta(min_length=3, max_length=3)]
