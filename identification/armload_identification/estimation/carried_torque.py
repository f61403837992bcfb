"""Torque of an arm's links and payload in a solution, for errors of a solution that change it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.estimation.arm_terms import GAIN, PAYLOAD
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import EMPTY, RunRows
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, payload_torque


def carried_torque(chain: Chain, body: BodyModel, theta: FloatArray, *states: FloatArray) -> FloatArray:
    """(N, n) joint torque of the links and of (10,) theta, at (N, n) positions, velocities and accelerations."""
    return body.link_torque(chain, *states) + payload_torque(chain, theta, *states)


def first_run_torque(
    found: Posterior, body: BodyModel, of_run: Callable[[ArmRows, FloatArray], FloatArray], *, of_all: bool = True
) -> list[FloatArray]:
    """(k, N, n) axis torque of k errors, as errors of the first run of every group.

    Args:
        found: The solution.
        body: The arm.
        of_run: (k, N, n) joint torque of the errors in the rows of a run that carries (10,) theta.
        of_all: Whether the other runs of a group have the same errors; else only the first.
    """
    to_axis = body.coupling * np.exp(found.value(GAIN))
    theta = {EMPTY: np.zeros(PARAMETERS), **{name: found.value(PAYLOAD, name) for name in found.problem.mountings}}

    def in_run(run: RunRows) -> FloatArray:
        return np.asarray(of_run(run.rows, theta[run.mounting]) @ to_axis)

    if not of_all:
        return [in_run(group.runs[0]) for group in found.problem.groups]
    return [group.mixed(np.stack([in_run(run) for run in group.runs]))[0] for group in found.problem.groups]
