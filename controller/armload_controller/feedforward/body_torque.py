"""The arm's own torque in addition to a payload's, from its calibration.

Two options, fed forward in addition to the payload's J^T w:

    LoadFriction    mu s (|tau_link + tau_payload| - |tau_link|)
    ArmTorque       all torque of the arm: tau_link + rotors + f_v dq
                    + s (f_c + f_r sqrt|dq| + mu |tau_link + tau_payload|)

with s the smoothed sign of velocity. Gear friction rises with load, so the first belongs to the payload's torque at the
motor. The torque that a drive reports at no load is its sensor's offset, and is not fed forward.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmDynamics

HOLDING_SHARE = 0.5
"""Share of a joint's Coulomb friction that reliably holds it in place."""


class ArmTerm(Protocol):
    """Torque of the arm, in addition to a payload's."""

    def torque_nm(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, payload_nm: FloatArray) -> FloatArray:
        """(n,) torque in N m to add to the payload's, at one state of (n,) each."""


def held_torque(body: BodyModel) -> FloatArray:
    """(n,) torque in N m that each joint's friction holds safely: tried at standstill for the arm's own torque."""
    return np.asarray(HOLDING_SHARE * body.coulomb_nm)


class LoadFriction:
    """Friction in the gears that the payload's weight and inertia cause."""

    def __init__(self, chain: Chain, body: BodyModel) -> None:
        self._dynamics, self._body = ArmDynamics(chain, body), body

    def torque_nm(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, payload_nm: FloatArray) -> FloatArray:
        """(n,) additional friction of the loaded arm over the empty one, in N m."""
        empty = self._dynamics.link_torque(q[None], dq[None], ddq[None])[0]
        return self._body.added_friction(empty, payload_nm, dq)


class ArmTorque:
    """All torque of the arm, including friction.

    Args:
        body: Its links, rotors and friction.
    """

    def __init__(self, chain: Chain, body: BodyModel) -> None:
        self._chain, self._body = chain, body

    def torque_nm(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, payload_nm: FloatArray) -> FloatArray:
        """(n,) torque of the loaded arm without the payload's, in N m."""
        body = self._body
        whole = body.torque(self._chain, q[None], dq[None], ddq[None], payload_nm[None])[0]
        return np.asarray(whole - body.offset_nm - payload_nm)
