"""Arrays that come from outside: copied, of the shape that is asked for, finite, and not to be changed afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import IdentificationError, ModelError


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
    if not np.isfinite(array).all():
        raise error(f"{name} contains a number that is not finite: {array.tolist()}")
    if above is not None and not (array > above).all():
        raise error(f"{name} is {array.tolist()}; expected numbers above {above:g}")
    if least is not None and not (array >= least).all():
        raise error(f"{name} is {array.tolist()}; expected numbers of at least {least:g}")
    if below is not None and not (array < below).all():
        raise error(f"{name} is {array.tolist()}; expected numbers below {below:g}")
    return array


def set_arrays(holder: object, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Set fields of a frozen dataclass to arrays that cannot be changed.

    Args:
        arrays: By name of the field; they become read-only.
    """
    for name, array in arrays.items():
        array.flags.writeable = False
        object.__setattr__(holder, name, array)
