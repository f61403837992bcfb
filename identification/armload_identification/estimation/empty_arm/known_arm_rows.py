"""Rows of a payload and of a run's changes of friction on a calibrated arm, in units of the prior.

    tau - tau_arm = (1 + mu s sgn(tau_l)) Phi theta + s dFc + dq dFv + dF0

The unit of each of the 10 + 3 n unknowns is its prior standard deviation, from the size of a payload and the drift of
friction, so that the prior information matrix is the identity.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from msgspec import Struct

from armload_identification.estimation.arm_terms import CHANGES
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import payload_regressor
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.signals.reversals import moving_weights

MOVING: Final = 10.0
"""Multiple of the reversal speed at which a row's weight is 0.7: as in the calibration, a tenth of the greatest speed
there."""
_TOOL_M: Final = 0.3
_OF_GRAVITY: Final = 9.81
_LEVER_M: Final = 0.5


def payload_scale(effort_nm: FloatArray) -> FloatArray:
    """(10,) size of a payload that an arm may carry: the strongest joint's torque at 0.5 m, in a tool of 0.3 m.

    Args:
        effort_nm: (n,) RMS torque of the joints.
    """
    mass = float(effort_nm.max()) / (_OF_GRAVITY * _LEVER_M)
    return mass * np.array([1.0] + [_TOOL_M] * 3 + [_TOOL_M**2] * 6)


def unloaded_columns(
    chain: Chain, body: BodyModel, spread: FloatArray, scale: FloatArray, states: JointStates
) -> FloatArray:
    """(K, n, 10 + 3 n) columns of payload and changes of friction in units of their priors; no friction under load.

    Args:
        chain: The arm, with the tilt of its calibration.
        body: The arm itself.
        spread: (3, n) unit of the changes of friction.
        scale: (10,) unit of the payload's parameters.
        states: (K, n) each.
    """
    dq = states.velocity_rad_s
    own = np.concatenate([smooth_sign(dq, body.reversal_speed_rad_s), dq, np.ones_like(dq)], axis=1) * spread.ravel()
    changes = own[:, None, :] * np.tile(np.eye(chain.n), CHANGES)
    return np.concatenate([payload_regressor(chain, *states) * scale, changes], axis=2)


def under_load(
    columns: FloatArray, links_nm: FloatArray, turning: FloatArray, payload: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns with the friction under load, linearised about a payload.

    Args:
        columns: (K, n, 10 + 3 n) without it.
        links_nm: (K, n) torque of the links.
        turning: (K, n) friction per torque times the direction of motion.
        payload: (10,) in units of its prior.

    Returns:
        The columns; (K, n) derivative of a joint's torque, friction included, by the torque that its gear carries; and
        (K, n) that torque.
    """
    unit, changes = columns[:, :, : len(payload)], columns[:, :, len(payload) :]
    carried_nm = links_nm + unit @ payload
    through = 1.0 + turning * np.sign(carried_nm)
    return np.concatenate([through[:, :, None] * unit, changes], axis=2), through, carried_nm


class KnownArmRows(Struct, frozen=True, eq=False):
    """K rows of n joints, weighted.

    Attributes:
        tall: (K n, 10 + 3 n) columns of payload and changes of friction, divided by the row's noise.
        weight: (K, n) inverse of a row's noise.
        scale: (10,) unit of the payload's parameters.
    """

    tall: FloatArray
    weight: FloatArray
    scale: FloatArray

    @classmethod
    def of(
        cls, chain: Chain, arm: KnownArm, states: JointStates, theta: FloatArray, noise_nm: FloatArray
    ) -> KnownArmRows:
        """The rows of a motion.

        Args:
            chain: The arm, with the tilt of its calibration.
            arm: Its calibration.
            states: (K, n) each.
            theta: (10,) the payload about which friction under load is linearised.
            noise_nm: (n,) or (K, n) noise of a row far from reversals, as if rows were independent.
        """
        body, scale = arm.body, payload_scale(arm.level_nm)
        unloaded = unloaded_columns(chain, body, arm.friction_spread, scale, states)
        turning = body.load_friction * smooth_sign(states.velocity_rad_s, body.reversal_speed_rad_s)
        columns, *_ = under_load(unloaded, body.link_torque(chain, *states), turning, theta / scale)
        weight = moving_weights(states.velocity_rad_s, MOVING * body.reversal_speed_rad_s) / noise_nm
        return cls((columns * weight[:, :, None]).reshape(-1, columns.shape[2]), weight, scale)

    def covariance(self, repeats: float = 1.0) -> FloatArray:
        """(10, 10) covariance of the payload from the rows' noise only.

        Args:
            repeats: How many times the rows are measured.
        """
        unit = np.linalg.inv(self._information(repeats))[:10, :10]
        return np.asarray(unit * self.scale[:, None] * self.scale)

    def shifts(self, doubts_nm: FloatArray, repeats: float = 1.0) -> FloatArray:
        """(k, 10) changes of the payload due to errors of the arm's torque.

        Args:
            doubts_nm: (k, K, n) these errors.
            repeats: How many times the rows are measured.
        """
        payload = np.eye(self.tall.shape[1], 10)
        pull = repeats * self.tall @ np.linalg.solve(self._information(repeats), payload)
        return np.asarray((doubts_nm * self.weight).reshape(len(doubts_nm), -1) @ pull * self.scale)

    def beside(self, torque_nm: FloatArray, others_nm: FloatArray, repeats: float) -> tuple[FloatArray, float]:
        """What the rows say of one further unknown, beside payload and friction.

        Args:
            torque_nm: (K, n) joint torque per unit of it.
            others_nm: (k, K, n) torques.
            repeats: How many times the rows are measured.

        Returns:
            (k,) estimate of the unknown from each of them, and its information.
        """
        column = (torque_nm * self.weight).ravel()
        pull = self.tall @ np.linalg.solve(self._information(repeats), repeats * self.tall.T @ column)
        alone = repeats * (column - pull)
        information = float(alone @ column)
        return (others_nm * self.weight).reshape(len(others_nm), -1) @ alone / information, information

    def _information(self, repeats: float) -> FloatArray:
        return np.asarray(np.eye(self.tall.shape[1]) + repeats * self.tall.T @ self.tall)
