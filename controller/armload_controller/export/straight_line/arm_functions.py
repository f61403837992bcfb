"""The functions generated for one arm, as expressions from which the C code is written."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Final

import numpy as np

from armload_controller.export.straight_line.expressions import Expression, Graph, Operations
from armload_controller.export.straight_line.planar_groups import planar_groups
from armload_controller.export.straight_line.specialised_dynamics import (
    SpecialisedArm,
    link_torque,
    specialised_regressor,
    specialised_torque,
)
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters

STATE: Final = ("q_rad", "dq_rad_s", "ddq_rad_s2")
"""Names of the arrays with the joint state."""
AT_REST: Final = STATE[:1]
"""The same of an arm at rest."""
THETA: Final = "theta"
"""Name of a payload's ten parameters, given with every call."""
_NEGLIGIBLE = 4e-15
"""Share of the greatest first moment, or inertia, below which a value is a rounding error."""


@dataclass(frozen=True)
class Function:
    """Expressions with named inputs and outputs.

    Attributes:
        graph: The graph of the expressions.
        inputs: Names of the input arrays, whether or not an output depends on them.
        outputs: Elements by name of the output array.
    """

    graph: Graph
    inputs: tuple[str, ...]
    outputs: Mapping[str, Sequence[Expression]]

    @property
    def elements(self) -> list[Expression]:
        """All elements of all outputs."""
        return [element for elements in self.outputs.values() for element in elements]

    @property
    def operations(self) -> Operations:
        """Its operation count."""
        return self.graph.operations(self.elements)


def torque_of(chain: Chain, payload: InertialParameters, state: tuple[str, ...] = STATE) -> Function:
    """Torque of one payload, whose numbers are constants: state, or q_rad `AT_REST`, -> torque_nm."""
    first_moment = payload.transformed(planar_groups(chain).flange).theta[1:3]
    # the last frame is rotated about its axis so that the first moment lies in its x z plane: one more zero
    turn_rad = float(np.arctan2(first_moment[1], first_moment[0]))
    arm, graph = _arm(chain, state, turn_rad)
    theta = _without_rounding(payload.transformed(arm.flange).theta)
    torque = specialised_torque(arm, [graph.constant(float(value)) for value in theta])
    return Function(graph, state, {"torque_nm": torque})


def any_torque(chain: Chain, state: tuple[str, ...] = STATE) -> Function:
    """Torque of any payload: state, or q_rad `AT_REST`, and theta, from `into_own`, -> torque_nm."""
    arm, graph = _arm(chain, state)
    return Function(graph, (*state, THETA), {"torque_nm": specialised_torque(arm, graph.inputs(THETA, 10))})


def regressor_of(chain: Chain) -> Function:
    """Regressor of a payload in the flange frame, row by row: state -> regressor (10 n)."""
    arm, graph = _arm(chain, STATE)
    return Function(graph, STATE, {"regressor": [element for row in specialised_regressor(arm) for element in row]})


def link_torque_of(chain: Chain, links: FloatArray) -> Function:
    """Torque of the arm's own links, (n, 10) in their joint frames: state -> links_nm."""
    arm, graph = _arm(chain, STATE)
    joints = sorted((joint for group in arm.groups for joint in group.joints), key=lambda joint: joint.index)
    placed = [
        _without_rounding(InertialParameters(theta).transformed(joint.link).theta)
        for joint, theta in zip(joints, links, strict=True)
    ]
    constants = [[graph.constant(float(value)) for value in theta] for theta in placed]
    return Function(graph, STATE, {"links_nm": link_torque(arm, constants)})


def into_own(chain: Chain) -> Function:
    """Linear map of theta from the flange frame to the frame in which torque is computed: theta -> own (10)."""
    flange = planar_groups(chain).flange
    columns = [_without_rounding(InertialParameters(unit).transformed(flange).theta) for unit in np.eye(10)]
    graph = Graph()
    theta = graph.inputs(THETA, 10)
    own = []
    for row in np.column_stack(columns):
        terms = [float(factor) * value for factor, value in zip(row, theta, strict=True)]
        own.append(reduce(operator.add, terms))
    return Function(graph, (THETA,), {"own": own})


def _arm(chain: Chain, state: tuple[str, ...], about_last_axis_rad: float = 0.0) -> tuple[SpecialisedArm, Graph]:
    """The arm in a new graph, moving or at rest."""
    graph = Graph()
    q, *moving = (graph.inputs(name, chain.n) for name in state)
    dq, ddq = moving or (None, None)
    return SpecialisedArm(graph, planar_groups(chain, about_last_axis_rad), q, dq, ddq), graph


def _without_rounding(theta: FloatArray) -> FloatArray:
    """Ten parameters, with those set to zero that are only rounding errors compared with their group."""
    scale = np.repeat([abs(theta[0]), np.abs(theta[1:4]).max(), np.abs(theta[4:]).max()], [1, 3, 6])
    return np.where(np.abs(theta) < _NEGLIGIBLE * scale, 0.0, theta)
