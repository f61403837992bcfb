"""Error of single precision: the same expressions in float and in double, over the arm's joint states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_controller.export.c_code.self_test import states_within
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.straight_line.arm_functions import (
    STATE,
    THETA,
    Function,
    any_torque,
    into_own,
    link_torque_of,
    torque_of,
)
from armload_controller.export.straight_line.expressions import NodeKind
from armload_controller.export.straight_line.precision import Precision
from armload_identification.float_array import FloatArray

STATES: Final = 10_000
_SEED: Final = 21
_BOUND_FACTOR: Final = 2.0
"""Factor from the greatest measured error to the stated bound, for other states and other math libraries."""
_OPERATIONS: Final = {
    NodeKind.COSINE: np.cos,
    NodeKind.SINE: np.sin,
    NodeKind.SUM: np.add,
    NodeKind.DIFFERENCE: np.subtract,
    NodeKind.PRODUCT: np.multiply,
}


@dataclass(frozen=True)
class SinglePrecisionError:
    """Difference of single from double precision.

    Attributes:
        bound_nm: Stated bound for every joint: twice the greatest measured difference.
        greatest_nm: Greatest torque in the same states, for comparison.
    """

    bound_nm: float
    greatest_nm: float

    @property
    def statement(self) -> str:
        """One sentence."""
        return (
            f"Single precision: torque within {self.bound_nm:.1e} N m of double precision, twice the greatest "
            f"difference at {STATES} joint states within the limits, where torque reaches {self.greatest_nm:.3g} N m."
        )


def single_precision_error(subject: ExportSubject) -> SinglePrecisionError:
    """Measure the error of float for a payload on an arm.

    Inputs are single precision numbers; the error of rounding them is not included. Measured are the code with the
    payload as constants, the code with the payload as an argument, and for a calibrated arm the torque of its links.
    """
    chain, payload = subject.chain, subject.payload.model
    states = _rounded(states_within(subject, STATES, _SEED))
    given = {name: states[:, k].T for k, name in enumerate(STATE)}
    theta = {THETA: _rounded(payload.theta)[:, None]}
    functions = [torque_of(chain, payload)]
    if subject.calibration is not None:
        functions.append(link_torque_of(chain, subject.calibration.body.links))
    differences = [_difference(function, given, given) for function in functions]
    own, coarse = (_evaluated(into_own(chain), theta, precision) for precision in Precision)
    differences.append(_difference(any_torque(chain), given | {THETA: own}, given | {THETA: coarse}))
    greatest = np.abs(_evaluated(functions[0], given, Precision.DOUBLE)).max()
    return SinglePrecisionError(_BOUND_FACTOR * max(differences), float(greatest))


def _rounded(values: FloatArray) -> FloatArray:
    """The values rounded to single precision."""
    return values.astype(np.float32).astype(np.float64)


def _difference(function: Function, fine: Mapping[str, FloatArray], coarse: Mapping[str, FloatArray]) -> float:
    """Greatest difference of any output."""
    exact = _evaluated(function, fine, Precision.DOUBLE)
    return float(np.abs(_evaluated(function, coarse, Precision.SINGLE) - exact).max())


def _evaluated(function: Function, inputs: Mapping[str, FloatArray], precision: Precision) -> FloatArray:
    """(outputs, states) as generated code computes them; (elements, states) of each input array."""
    dtype = precision.dtype
    variables = {f"{name}[{i}]": row.astype(dtype) for name, array in inputs.items() for i, row in enumerate(array)}
    values: dict[int, NDArray[np.floating]] = {}
    graph = function.graph
    for number in graph.needed(function.elements):
        node = graph.nodes[number]
        operands = [values[operand] for operand in node.operands]
        match node.kind:
            case NodeKind.CONSTANT:
                values[number] = np.full(1, node.value, dtype)
            case NodeKind.INPUT:
                values[number] = variables[node.name]
            case _:
                values[number] = _OPERATIONS[node.kind](*operands)
    zero = np.zeros(1, dtype)
    outputs = [zero if e.is_zero else e.sign * values[e.number] for e in function.elements]
    return np.array(np.broadcast_arrays(*outputs), dtype=np.float64)
