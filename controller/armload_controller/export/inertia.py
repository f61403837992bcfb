"""The choice of the inertia to write: undetermined elements are never presented as measurements.

A format either needs a complete inertia, or zero is what its controller takes if nothing is entered, or is documented
as a point mass.

- All elements of the format are determined: they are written.
- Some are determined: a point mass would be wrong, so the complete model is written and the others are named.
- None is determined: a point mass if the controller supports it, else the model, and the text states which.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.payload import PARAMETER_NAMES, TENSOR_ELEMENTS, PayloadResult

TENSOR = TENSOR_ELEMENTS
"""Elements of a format with a complete tensor, or with principal moments and axes."""
MOMENTS = TENSOR_ELEMENTS[:3]
"""Elements of a format with moments about the flange's axes and without products."""

_TIE_BREAK = 1e-12
"""Share of the trace by which moments differ that a tensor leaves equal: far above rounding, far below any use."""

QUARTER_TURNS = tuple(
    turn
    for order in itertools.permutations(np.eye(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
    if np.linalg.det(turn := np.array(order).T * np.array(signs)) > 0.0
)
"""The 24 rotations by quarter turns about the axes: all right-handed orders and signs of three axes."""


class WrittenInertia(NamedTuple):
    """The inertia written to a file.

    Attributes:
        tensor_kg_m2: (3, 3) about the centre of mass, in the flange's axes; zero for a point mass.
        statement: One sentence for the exported text.
    """

    tensor_kg_m2: FloatArray
    statement: str


def complete_inertia(
    payload: PayloadResult, elements: tuple[str, ...], *, or_point_mass: bool = False
) -> WrittenInertia:
    """The inertia for a format.

    Args:
        elements: Elements of the format.
        or_point_mass: Whether the controller interprets zero as a point mass.
    """
    tensor_kg_m2 = payload.model.inertia_about_com
    undetermined = tuple(name for name in elements if not payload.determined[PARAMETER_NAMES.index(name)])
    if not undetermined:
        return WrittenInertia(tensor_kg_m2, "Inertia: measured; all elements written here are determined.")
    begin = f"Inertia: NOT DETERMINED by the measurement: {', '.join(undetermined)}."
    if or_point_mass and undetermined == elements:
        default = "Zero is written: a point mass in the centre of mass, the controller's own default."
        return WrittenInertia(np.zeros((3, 3)), f"{begin} {default}")
    return WrittenInertia(
        tensor_kg_m2,
        f"{begin} For these, the values of the model that completes the measured ones to a physically possible body "
        "are written. They are not measurements.",
    )


def principal_inertia(tensor_kg_m2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments and axes, I = R diag(moments) R^T, the axes ordered and signed to be closest to the frame's.

    Of the 24 right-handed orders and signs of the three axes, the one with the greatest trace of R is chosen. It is
    less than 63 degrees from the frame, so no Euler angle is near a singularity, and a diagonal tensor gives R = 1.
    Where equal moments leave a choice, the axes are those of the frame, not those that rounding happens to give.

    Args:
        tensor_kg_m2: (3, 3) symmetric.

    Returns:
        (3,) moments in kg m2 about the principal axes x, y, z; (3, 3) R, whose columns are the axes, right-handed.
    """
    _, axes = np.linalg.eigh(tensor_kg_m2 + _TIE_BREAK * np.trace(tensor_kg_m2) * np.diag([0.0, 1.0, 2.0]))
    right_handed = axes * np.sign(np.linalg.det(axes))
    rotation = max((right_handed @ turn for turn in QUARTER_TURNS), key=np.trace)
    return np.diag(rotation.T @ tensor_kg_m2 @ rotation), rotation
