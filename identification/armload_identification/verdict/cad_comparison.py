"""Comparison of a payload with CAD, in the paper's convention: Chen 2016, Table 2 and eq. (13).

The paper states mass, centre of mass and the inertia about the ORIGIN of the payload's frame, with products of inertia
+int xy dm; this convention is used only here. The error is |estimate - truth| / |truth|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import InertialParameters, PayloadResult


@dataclass(frozen=True, eq=False)
class RelativeErrors:
    """Ten values in the paper's convention: m, c_x, c_y, c_z, I_xx, I_yy, I_zz, I_xy, I_xz, I_yz.

    Attributes:
        frame: Name of the frame.
        estimate: (10,) identified values, complete as in the file's `[model]`.
        truth: (10,) reference values.
        error: (10,) |estimate - truth| / |truth|; inf where the truth is 0 and the estimate is not.
        determined: (10,) True if all values from which the entry is computed were determined.
    """

    frame: str
    estimate: FloatArray
    truth: FloatArray
    error: FloatArray
    determined: NDArray[np.bool_]


def compare_with_cad(payload: PayloadResult, cad: PayloadResult) -> RelativeErrors:
    """Relative errors of an identified payload against CAD, inertia about the origin of the frame.

    Raises:
        PayloadFileError: the two are in different frames.

    References:
        Chen 2016, eq. (13), Table 2.
    """
    if payload.frame != cad.frame:
        expected = f"expected {payload.frame!r}, the frame of the identified payload: both must be in the same frame"
        raise PayloadFileError("CAD file", "payload.frame", cad.frame, expected)
    estimate, truth = in_papers_convention(payload.model), in_papers_convention(cad.model)
    off = np.abs(estimate - truth)
    error = np.divide(off, np.abs(truth), out=np.where(off > 0.0, np.inf, 0.0), where=truth != 0.0)
    # The inertia about the origin also depends on mass and centre of mass.
    determined = np.asarray(payload.determined).copy()
    determined[4:] &= determined[:4].all()
    return RelativeErrors(payload.frame, estimate, truth, error, determined)


def in_papers_convention(body: InertialParameters) -> FloatArray:
    """(10,) mass, centre of mass, inertia about the origin with products +int xy dm: Chen 2016, Table 2.

    References:
        Chen 2016, Table 2.
    """
    moments, products = body.theta[4:7], body.theta[7:]
    return np.concatenate([[body.mass_kg], body.center_of_mass_m, moments, -products])
