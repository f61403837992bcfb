"""Joints as messages name them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray


def named_joints(names: Sequence[str]) -> str:
    """'joint 2' or 'joints 1, 2 and 5'.

    Args:
        names: One or more joints, each as its number from 1, with a remark or not: '3 (12 %)'.
    """
    return f"joint{'' if len(names) == 1 else 's'} {listed(names)}"


def remarked_joints(joints: NDArray[np.bool_], remark: str, values: FloatArray) -> str:
    """'joints 2 (12 %) and 3 (9 %)': the joints that are True with their values of (n,) in a format; '' without any."""
    names = [f"{joint + 1} ({remark.format(values[joint])})" for joint in np.flatnonzero(joints)]
    return named_joints(names) if names else ""


def listed(parts: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def numbered_joints(joints: NDArray[np.bool_]) -> str:
    """'joint 2', 'joints 1, 2 and 5' or 'joints 4 to 6': the joints that are True, by number.

    Args:
        joints: (n,) at least one of them True.
    """
    numbers = [int(joint) + 1 for joint in np.flatnonzero(joints)]
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"joints {numbers[0]} to {numbers[-1]}"
    return named_joints([str(number) for number in numbers])
