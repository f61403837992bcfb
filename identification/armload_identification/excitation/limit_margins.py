"""Margins of a motion to its limits."""

from __future__ import annotations

from msgspec import field

from armload_identification.storage.strict_toml import NumberList, Table

PER_JOINT = ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3", "torque_nm")


class LimitMargins(Table):
    """Smallest margins of a motion over all times, positive within the limits; `[margins]` of an excitation's file.

    Attributes:
        position_rad: (n,) to the nearer of the two position limits.
        velocity_rad_s: (n,) to the speed limit.
        acceleration_rad_s2: (n,) to the acceleration limit.
        jerk_rad_s3: (n,) to the jerk limit.
        torque_nm: (n,) to the torque limit, in the worst case of load and speed.
        clearance_m: Distance from each obstacle, and between links that are kept apart, by name; the distance to
            keep is not subtracted.
        speed_m_s: Margin to the limit of the arm's speed, by point; empty if speed is not limited.
    """

    position_rad: NumberList
    velocity_rad_s: NumberList
    acceleration_rad_s2: NumberList
    jerk_rad_s3: NumberList
    torque_nm: NumberList
    clearance_m: dict[str, float] = field(default_factory=dict)
    speed_m_s: dict[str, float] = field(default_factory=dict)
