"""The empty arm: links, rotors and friction as one model of joint torque.

    tau = Y(q, dq, ddq) beta + C^-T diag(I_r) C^-1 ddq
        + s (f_c + f_r sqrt|dq| + mu |Y beta|) + f_v dq + f_0

with s the direction of motion. Of the links' parameters only the identifiable ones are kept, the base parameters. The
others are zero and their effect is lumped into those kept, so that the total is the arm's torque, but a single number
is not the mass or inertia of one link.

References:
    Chen 2016, eqs. (1), (3). Gautier, Numerical calculation of the base inertial parameters of robots, Journal of
    Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.model.finite_array import finite_array
from armload_identification.model.links_and_drives import LinksAndDrives
from armload_identification.model.regressor import PARAMETERS
from armload_identification.model.smooth_sign import smooth_sign


@dataclass(frozen=True, eq=False)
class BodyModel(LinksAndDrives):
    """Torque of an arm of n joints without a payload.

    Coulomb and viscous friction and the coupling are those of `LinksAndDrives`.

    Attributes:
        links: (n, 10) base parameters of the links in their joint frames; zero where regrouped into others.
        base: (n, 10) True for base parameters.
        rotor_inertia_kg_m2: (n,) of the axes, reflected through the gear; 0 if the links' parameters include it: on
            a joint whose rotor cannot be separated from a link and whose friction does not grow with its load.
        root_nm: (n,) friction per square root of speed, N m / sqrt(rad/s), as in lubricated gears of high ratio.
        offset_nm: (n,) torque reported at no load.
        load_friction: (n,) friction per torque of the links.
        torque_delay_s: Delay of the reported torque relative to the reported position.
        reversal_speed_rad_s: (n,) v in the direction of motion s = tanh(dq / v).

    Raises:
        ModelError: shapes that do not fit, or numbers that are not finite.
    """

    base: NDArray[np.bool_]
    root_nm: FloatArray
    offset_nm: FloatArray
    load_friction: FloatArray
    torque_delay_s: float
    reversal_speed_rad_s: FloatArray

    def __post_init__(self) -> None:
        super().__post_init__()
        n = self.n
        shapes = {"base": (n, PARAMETERS), "torque_delay_s": ()}
        for field in fields(self)[len(fields(LinksAndDrives)) :]:
            above = 0.0 if field.name == "reversal_speed_rad_s" else None
            name, value = f"{field.name} of the body", getattr(self, field.name)
            finite_array(name, value, shapes.get(field.name, (n,)), above=above)

    def link_torque(self, chain: Chain, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Torque of the links, Y beta.

        Args:
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.

        Returns:
            (N, n) in N m, without rotors and friction.
        """
        return _dynamics(chain, self).link_torque(q, dq, ddq)

    def unloaded_friction(self, speed_rad_s: FloatArray) -> FloatArray:
        """(n,) friction without load at (n,) rad/s, f_c + f_r sqrt(v) + f_v v, in N m."""
        return np.asarray(self.coulomb_nm + self.root_nm * np.sqrt(speed_rad_s) + self.viscous_nm_s_rad * speed_rad_s)

    def added_friction(self, empty_nm: FloatArray, payload_nm: FloatArray, dq: FloatArray) -> FloatArray:
        """Friction under a payload beyond that of the empty arm, mu s (|tau_link + tau_payload| - |tau_link|).

        Args:
            empty_nm: (N, n) torque of the links.
            payload_nm: (N, n) torque of the payload.
            dq: (N, n) velocities in rad/s.

        Returns:
            (N, n) in N m. Computed from the motors' torque, which includes friction, it would make results worse.
        """
        direction = smooth_sign(dq, self.reversal_speed_rad_s)
        return np.asarray(self.load_friction * direction * (np.abs(empty_nm + payload_nm) - np.abs(empty_nm)))

    def torque(
        self, chain: Chain, q: FloatArray, dq: FloatArray, ddq: FloatArray, payload_nm: FloatArray | None = None
    ) -> FloatArray:
        """Joint torque of the arm, friction included.

        Args:
            chain: The arm.
            q: (N, n) positions in rad.
            dq: (N, n) velocities in rad/s.
            ddq: (N, n) accelerations in rad/s2.
            payload_nm: (N, n) torque of a payload, which is added and also causes load-dependent friction.

        Returns:
            (N, n) in N m.
        """
        carried = self.link_torque(chain, q, dq, ddq)
        if payload_nm is not None:
            carried = carried + payload_nm
        direction = smooth_sign(dq, self.reversal_speed_rad_s)
        friction = self.coulomb_nm + self.load_friction * np.abs(carried) + self.root_nm * np.sqrt(np.abs(dq))
        rotors = ddq @ self.rotor_mass_kg_m2
        return np.asarray(carried + rotors + direction * friction + self.viscous_nm_s_rad * dq + self.offset_nm)


@lru_cache(maxsize=4)
def _dynamics(chain: Chain, body: BodyModel) -> ArmDynamics:
    """Links turned for the kernels, kept because an estimator in the loop needs the same ones again and again."""
    return ArmDynamics(chain, body)
