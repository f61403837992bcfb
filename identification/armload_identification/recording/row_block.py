"""Rows of one run with the same quantities in every row, as readers yield and recordings contain them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError

QUANTITIES: Final = ("time_s", "position_rad", "velocity_rad_s", "current_a", "torque_nm", "phase_s")
BLOCK_ROWS: Final = 2**13
"""Rows that a reader gives at once: enough for fast array operations, little beside the run."""


@dataclass(frozen=True, eq=False)
class RowBlock:
    """N rows of an arm of n joints in SI units.

    Attributes:
        time_s: (N,) time stamps.
        position_rad: (N, n) measured joint positions.
        velocity_rad_s: (N, n) measured joint velocities, or None.
        current_a: (N, n) measured MOTOR currents, or None.
        torque_nm: (N, n) measured JOINT torques, or None.
        phase_s: (N,) phase along the excitation, NaN outside the streamed whole periods; None without a known
            excitation.
    """

    time_s: FloatArray
    position_rad: FloatArray
    velocity_rad_s: FloatArray | None = None
    current_a: FloatArray | None = None
    torque_nm: FloatArray | None = None
    phase_s: FloatArray | None = None

    @classmethod
    def of_columns(cls, columns: Mapping[str, FloatArray], scale: Mapping[str, float]) -> Self:
        """Rows of a table, without a phase.

        Args:
            columns: (N, k) by quantity: the time, and perhaps nanoseconds to add to it, and n columns of every other;
                absent quantities become None.
            scale: Factor on the numbers of a quantity, 1 if not given.
        """
        scaled = {name: scale.get(name, 1.0) * values for name, values in columns.items()}
        seconds, *nanoseconds = scaled["time_s"].T
        return cls(**{**scaled, "time_s": seconds + 1e-9 * nanoseconds[0] if nanoseconds else seconds})

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.position_rad.shape[1])

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.time_s.size)

    @property
    def effort(self) -> FloatArray | None:
        """(N, n) effort reported by the drives: joint torque, else motor current; None without either."""
        return self.current_a if self.torque_nm is None else self.torque_nm

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Self:
        """Some of the rows.

        Args:
            chosen: (N,) True for rows to keep, indices in order, or a slice.
        """
        return self.each(lambda values: values[chosen])

    def each(self, function: Callable[[FloatArray], FloatArray]) -> Self:
        """The rows with a function of (N,) or (N, ...) values applied to every quantity that they have."""
        given = {name: values for name in QUANTITIES if (values := getattr(self, name)) is not None}
        return replace(self, **{name: function(values) for name, values in given.items()})


def hash_of(arrays: Mapping[str, FloatArray]) -> str:
    """SHA-256 of named arrays."""
    digest = hashlib.sha256()
    for name, values in arrays.items():
        digest.update(f"{name}{values.shape}".encode() + np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def require_shapes(name: str, arrays: Mapping[str, FloatArray]) -> None:
    """Raise unless the arrays of a recording have consistent shapes.

    Args:
        name: Where they are from, in the message.
        arrays: By quantity, the positions among them.

    Raises:
        RecordingError: naming an array, its shape and the expected one.
    """
    position = arrays["position_rad"]
    if position.ndim != 2 or not position.size:
        raise RecordingError(f"{name}: position_rad has shape {position.shape}; expected (N, n), a row per sample")
    for key, values in arrays.items():
        expected = position.shape[:1] if key in {"time_s", "phase_s"} else position.shape
        if values.shape != expected:
            raise RecordingError(
                f"{name}: {key} has shape {values.shape}; expected {expected}, as position_rad has {position.shape}"
            )


def parts_of(arrays: Mapping[str, FloatArray]) -> Iterator[dict[str, FloatArray]]:
    """Arrays of N rows, some thousand rows at a time."""
    for first in range(0, len(arrays["time_s"]), BLOCK_ROWS):
        yield {name: values[first : first + BLOCK_ROWS] for name, values in arrays.items()}


def joined(blocks: Sequence[RowBlock]) -> RowBlock:
    """Blocks of one run, one after the other.

    Args:
        blocks: At least one, all with the same quantities.
    """
    first, *others = blocks
    given = [name for name in QUANTITIES if others and getattr(first, name) is not None]
    return replace(first, **{name: np.concatenate([getattr(block, name) for block in blocks]) for name in given})
