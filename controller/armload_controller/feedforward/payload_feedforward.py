"""The payload's torque for a control loop, computed from the joint state.

Intended for import into any control process: it loads only numpy and the compiled kernels, and a call allocates
nothing.
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from armload_core import kernels
from armload_identification.identification_errors import ModelError, PayloadFileError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters
from armload_identification.model.regressor import feedforward_model

if TYPE_CHECKING:
    from armload_controller.config.objects_or_paths import PayloadSource
    from armload_controller.config.robot_recordings import MeasuredArm

NOTHING = InertialParameters(np.zeros(10))
"""The empty flange."""


class PayloadFeedforward(kernels.PayloadTorque):
    """Joint torque required by a payload at the flange.

        tau = J(q)^T w(q, dq, ddq, theta)

    `torque_nm(position_rad, velocity_rad_s, acceleration_rad_s2)`, all (n,), returns the (n,) torques in N m. It is the
    compiled class's own method without a Python wrapper: the returned array is overwritten by the next call, and a
    state that does not have n joints raises ValueError. Call it from one thread only, the loop's; `set_payload` may be
    called from any.

    Args:
        robot: The arm, n joints: its chain, a robot or a `UrdfArm`; or a name or path, from which it is read.
        payload: The payload, in the flange frame; the result of an identification, or the path of its file.

    Raises:
        PayloadFileError: the payload was identified on another arm.
        ModelError: no body has its parameters; also raised by `set_payload`.

    References:
        Chen 2016, eq. (2).

    Examples:
        >>> import armload, numpy as np
        >>> feedforward = armload.PayloadFeedforward("er50", "runs/today/payload.toml")
        >>> still = np.zeros(6)
        >>> feedforward.torque_nm(np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]), still, still).shape
        (6,)
        >>> feedforward.set_payload(armload.NOTHING, transition_s=0.2, cycle_s=0.001)
    """

    __slots__ = ()

    def __init__(
        self,
        robot: Chain | MeasuredArm | str | PathLike[str],
        payload: InertialParameters | PayloadSource,
    ) -> None:
        if isinstance(robot, Chain):
            chain = robot
        else:
            from armload_controller.config.objects_or_paths import arm_of, payload_from
            from armload_controller.feedforward.payload_use import another_arms

            arm = arm_of(robot)
            chain = arm.chain
            if not isinstance(payload, InertialParameters):
                payload = payload_from(payload, "payload")
                if problem := another_arms(payload, chain, arm.name):
                    raise PayloadFileError("`payload=`", "", None, problem)
        super().__init__(feedforward_model(chain, _body(payload).theta), np.zeros(chain.n))

    def set_payload(self, payload: InertialParameters | PayloadSource, transition_s: float, cycle_s: float) -> None:
        """Change the payload while running, without a step in torque: after a grasp or a release.

        From the next call the parameters move to the new ones, with zero rate at both ends. Torque is linear in them,
        and every intermediate body is physically possible. A second change continues from the present values.

        Args:
            payload: The new payload, as at first; `armload.NOTHING` for an empty flange.
            transition_s: Duration of the change; 0 for immediately.
            cycle_s: Time between two calls of `torque_nm`.

        Raises:
            ValueError: `transition_s` is negative, or `cycle_s` is not positive.
        """
        if not (transition_s >= 0.0 and cycle_s > 0.0):
            raise ValueError(f"transition_s = {transition_s} and cycle_s = {cycle_s}: expected >= 0 and > 0")
        self.change_parameters(_body(payload).theta, max(1, round(transition_s / cycle_s)))


def _body(payload: InertialParameters | PayloadSource) -> InertialParameters:
    """The body of a payload, or of its file."""
    if not isinstance(payload, InertialParameters):
        from armload_controller.config.objects_or_paths import payload_from

        payload = payload_from(payload, "payload").model
    if payload.theta.any() and payload.margin < -SMALLEST_MARGIN:
        raise ModelError(
            f"no body has the parameters of the payload: the margin of its pseudo-inertia is {payload.margin:.3g}; "
            "expected 0 or more"
        )
    return payload
