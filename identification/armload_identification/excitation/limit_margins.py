"""How much room a motion leaves to its limits, and the table of an excitation's file that says so."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_FLOOR, Context

from armload_core.arrays import FloatArray
from armload_identification import strict_toml

_ARRAYS = ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3", "torque_nm")
_DIGITS = Context(prec=6, rounding=ROUND_FLOOR)


@dataclass(frozen=True, eq=False, slots=True)
class LimitMargins:
    """How much room a motion leaves at any time; positive inside.

    Attributes:
        position_rad: (n,) to the nearer of the two position limits.
        velocity_rad_s: (n,) to the speed limit.
        acceleration_rad_s2: (n,) to the acceleration limit.
        jerk_rad_s3: (n,) to the jerk limit.
        torque_nm: (n,) to the torque limit, in the worst case of load and speed.
        clearance_m: Distance from each obstacle, and between links that are kept apart, by name; what is to be kept
            of it included.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    jerk_rad_s3: FloatArray
    torque_nm: FloatArray
    clearance_m: dict[str, float]

    @property
    def smallest(self) -> float:
        """The smallest number of all; above 0 where the motion is strictly feasible."""
        return min(*(float(getattr(self, name).min()) for name in _ARRAYS), *self.clearance_m.values())

    def lines(self) -> list[str]:
        """The table `[margins]` of an excitation's file, rounded down to six digits."""
        rows = ["# room left at any time, within what the design may use of each limit", "[margins]"]
        rows += [f"{name} = [{', '.join(_rounded(v) for v in getattr(self, name))}]" for name in _ARRAYS]
        if self.clearance_m:
            near = {strict_toml.text(name): _rounded(value) for name, value in self.clearance_m.items()}
            rows.append(f"clearance_m = {strict_toml.inline(near)}")
        return rows

    @classmethod
    def from_table(cls, table: strict_toml.TomlTable, n: int) -> LimitMargins:
        """What `lines` wrote.

        Args:
            table: `[margins]`.
            n: Number of joints.

        Raises:
            IdentificationError: of the file's class, naming the key that is wrong.
        """
        position, velocity, acceleration, jerk, torque = (table.array(name, (n,)) for name in _ARRAYS)
        clearance: dict[str, float] = {}
        if "clearance_m" in table:
            near = table.table("clearance_m")
            clearance = {name: near.number(name) for name in near.names()}
        table.close()
        return cls(position, velocity, acceleration, jerk, torque, clearance)


def _rounded(value: float) -> str:
    """Six digits, never more than the value."""
    return repr(float(_DIGITS.create_decimal(repr(float(value)))))
