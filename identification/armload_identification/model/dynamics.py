"""Torque of an arm, with a payload if it has one, and its derivative along a motion.

tau = M(q) ddq + C(q, dq) dq + g(q), rotors included                    Chen 2016, eq. (1) without friction

For both kinds of model: an arm as specified (`ArmBody`) and as identified (`BodyModel`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from armload_core import kernels
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.finite_array import finite_array, set_fields
from armload_identification.model.links_and_drives import DRIVE_FIELDS, LinksAndDrives
from armload_identification.model.payload import InertialParameters, symmetric_tensor, tensor_elements


@dataclass(frozen=True, eq=False)
class ArmBody(LinksAndDrives):
    """Links, rotors and friction of an arm, as specified.

    Raises:
        ModelError: shapes that do not fit, a number that is not finite, friction or a rotor below zero, or a
            coupling without an inverse.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in DRIVE_FIELDS:
            finite_array(f"{name} of the body", getattr(self, name), (self.n,), least=0.0)

    @classmethod
    def massless(cls, n: int) -> ArmBody:
        """An arm of n joints without mass and friction, so that only the payload's torque remains."""
        return cls(np.zeros((n, 10)), np.zeros(n), np.zeros(n), np.zeros(n), np.eye(n))

    def carrying(self, chain: Chain, payload: InertialParameters) -> ArmBody:
        """The same arm with a body at its flange, as part of the last link.

        Args:
            chain: The arm's kinematics.
            payload: In the flange frame.
        """
        links = self.links.copy()
        links[-1] += payload.transformed(chain.flange).theta
        return replace(self, links=links)


@dataclass(frozen=True, eq=False)
class ArmDynamics:
    """Torque that links and rotors require of the motors, without friction.

    Attributes:
        chain: Kinematics and gravity.
        body: Links, rotors and coupling; its friction is not used.
        turned_links: (n, 10) the links in the turned joint frames of `chain.packed`, for the kernels.

    Raises:
        ModelError: numbers of joints that differ.
    """

    chain: Chain
    body: LinksAndDrives
    turned_links: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.chain.n != self.body.n:
            raise ModelError(f"a body of {self.body.n} links for a chain of {self.chain.n} joints")
        set_fields(self, {"turned_links": _turned(self.chain, self.body.links)})

    def link_torque(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Joint torque of the links.

        Args:
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (N, n) torques in N m.
        """
        q, dq, ddq = (np.ascontiguousarray(a, dtype=np.float64) for a in (q, dq, ddq))
        out = np.empty_like(q)
        kernels.arm_torque_into(self.chain.packed, self.turned_links, q, dq, ddq, out)
        return out

    def torque(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Joint torque of links and rotors.

        Args:
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (N, n) torques in N m.
        """
        return np.asarray(self.link_torque(q, dq, ddq) + ddq @ self.body.rotor_mass_kg_m2)

    def slope(self, weight: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all torques by the samples.

        Args:
            weight: (N, n) weight of each torque.
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (3, N, n) derivative by q, dq and ddq.
        """
        q, dq, ddq, weight = (np.ascontiguousarray(a) for a in (q, dq, ddq, weight))
        slope = np.zeros((3, *q.shape))
        kernels.arm_torque_slope_into(self.chain.packed, self.turned_links, weight, q, dq, ddq, slope)
        slope[2] += weight @ self.body.rotor_mass_kg_m2
        return slope


def _turned(chain: Chain, links: FloatArray) -> FloatArray:
    """(n, 10) links in the turned joint frames; vectorised, because a feed-forward does this in every cycle."""
    turn = np.array([chain.turned_back(i) for i in range(chain.n)])
    turned = links.copy()
    turned[:, 1:4] = (turn @ links[:, 1:4, None])[:, :, 0]
    turned[:, 4:] = tensor_elements(turn @ symmetric_tensor(links[:, 4:]) @ turn.transpose(0, 2, 1))
    return turned
