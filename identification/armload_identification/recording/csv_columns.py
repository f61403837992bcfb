"""Which columns of a table hold what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class CsvColumns:
    """Which columns of a CSV file hold what: numbers from zero, or names of a header line.

    Attributes:
        time: Column of the time stamp in s.
        position: One column per joint, rad.
        velocity: One per joint, rad/s; None where the log has none.
        current: One per joint, MOTOR current in A; None where the log has torque.
        torque: One per joint, JOINT torque in N m; None where the log has current.
    """

    time: int | str
    position: Sequence[int | str]
    velocity: Sequence[int | str] | None = None
    current: Sequence[int | str] | None = None
    torque: Sequence[int | str] | None = None

    def groups(self) -> dict[str, list[int | str]]:
        """The columns by the name of the quantity, those that are there."""
        groups: dict[str, list[int | str]] = {"time_s": [self.time], "position_rad": list(self.position)}
        for name, columns in (
            ("velocity_rad_s", self.velocity),
            ("current_a", self.current),
            ("torque_nm", self.torque),
        ):
            if columns is not None:
                groups[name] = list(columns)
        return groups
