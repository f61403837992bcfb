"""Arrays that come from outside: copied, of the shape that is asked for, finite, and not to be changed afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError, ModelError

SHOWN: Final = 20
"""Most numbers that a message lists."""


def finite_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | None, ...],
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    error: type[IdentificationError] = ModelError,
) -> FloatArray:
    """A copy of an array of finite numbers.

    Args:
        name: Name in messages.
        shape: Expected shape; None for any length.
        above: All numbers must be above this.
        least: No number may be below this.
        below: All numbers must be below this.
        error: What is raised.

    Raises:
        IdentificationError: of the given kind, naming the array, what was found and what was expected.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise error(f"{name} is not an array of numbers: {problem}") from problem
    if array.ndim != len(shape) or any(s is not None and s != a for s, a in zip(shape, array.shape, strict=True)):
        wanted = str(tuple("n" if s is None else s for s in shape)).replace("'", "")
        raise error(f"{name} has shape {array.shape}; expected {wanted}")
    if not (good := np.isfinite(array)).all():
        raise error(f"{name} contains a number that is not finite: {_shown(array, good)}")
    bounds = (above, np.greater, "above"), (least, np.greater_equal, "of at least"), (below, np.less, "below")
    for bound, keeps, words in bounds:
        if bound is not None and not (good := keeps(array, bound)).all():
            raise error(f"{name} is {_shown(array, good)}; expected numbers {words} {bound:g}")
    return array


def _shown(array: FloatArray, good: NDArray[np.bool_]) -> str:
    """A short array whole; of a longer one the first number that is wrong, its place, and how many are."""
    if array.size <= SHOWN:
        return str(array.tolist())
    wrong = np.argwhere(~good)
    return f"{array[tuple(wrong[0])]:g} at {wrong[0].tolist()} ({len(wrong)} of {array.size} numbers are wrong)"


def set_fields(holder: object, values: Mapping[str, object]) -> None:
    """Set fields of a frozen dataclass.

    Args:
        values: By name of the field; arrays become read-only.
    """
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        object.__setattr__(holder, name, value)
