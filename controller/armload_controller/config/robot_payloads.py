"""The payloads that a robot's file names, and whether its joints can hold them."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING

import numpy as np

from armload_controller.config.robot_source import RobotSource
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque

if TYPE_CHECKING:
    from armload_identification.excitation.geometry.cartesian_speed import CarriedSphere

_POSES = 512
"""Random poses in which the joints must hold every payload at rest."""


@dataclass(frozen=True, eq=False)
class RobotPayloads:
    """The payloads of a robot's file, in the flange frame.

    Attributes:
        source: The robot's file.
    """

    source: RobotSource

    @property
    def expected(self) -> InertialParameters:
        """The payload that excitations are designed for.

        Raises:
            ConfigurationError: the file names no expected payload.
        """
        table = self.source.tables.expected_payload
        if table is None:
            raise self.source.refused("expected_payload", None, "required to design an excitation")
        return table.inertial()

    @property
    def heaviest(self) -> InertialParameters:
        """The heaviest payload that a motion must be safe with; the expected one if the file names none.

        Raises:
            ConfigurationError: the file names neither.
        """
        heaviest = self.heaviest_if_stated
        if heaviest is None:
            raise self.source.refused("heaviest_payload", None, "required: the payload that the arm may have to carry")
        return heaviest

    @property
    def heaviest_if_stated(self) -> InertialParameters | None:
        """The same, or None if the file names neither."""
        table = self.source.tables.heaviest_payload or self.source.tables.expected_payload
        return None if table is None else table.inertial()

    @property
    def design_set(self) -> tuple[InertialParameters, ...]:
        """The payloads that a robust excitation is designed for; empty if the file names none."""
        return tuple(payload.inertial() for payload in self.source.tables.payload_set.values())

    @property
    def envelopes(self) -> tuple[CarriedSphere, ...]:
        """Spheres around the expected and the heaviest payload, as far as the file names them."""
        return tuple(
            table.envelope(key.replace("_", " ")) for key, table in self.source.tables.carried_payloads().items()
        )

    @property
    def assumed_envelopes(self) -> tuple[str, ...]:
        """Notes for the operator on the payloads whose envelope the file does not state."""
        notes = []
        for key, table in self.source.tables.carried_payloads().items():
            radius_m, basis = table.assumed_radius
            if table.envelope_radius_m is None:
                notes.append(
                    f"[{key}] states no envelope_radius_m: at reduced speed the payload is assumed to lie within "
                    f"{radius_m:.3f} m of its centre of mass, from {basis}"
                )
        return tuple(notes)

    def require_carried(self) -> None:
        """Refuse payloads above the rated one, or that the joints cannot hold.

        Raises:
            ConfigurationError: naming the payload, and the joint that is too weak for it.
        """
        tables, chain = self.source.tables, self.source.chain
        rated_kg = tables.robot.rated_payload_kg
        torque_max_nm = np.array([joint.torque_max_nm for joint in tables.joints])
        ranges = [(joint.position_min_rad, joint.position_max_rad) for joint in tables.joints]
        uniform = Random(0).uniform  # NumPy's generators take as long to load as all of this
        q = np.array([[uniform(*ends) for ends in ranges] for _ in range(_POSES)])
        still = np.zeros_like(q)
        for key, payload in tables.payloads().items():
            if payload.mass_kg > rated_kg:
                expected = f"expected at most robot.rated_payload_kg = {rated_kg:g}"
                raise self.source.refused(f"{key}.mass_kg", payload.mass_kg, expected)
            torque = np.abs(payload_torque(chain, payload.inertial().theta, q, still, still)).max(axis=0)
            weakest = int(np.argmax(torque / torque_max_nm))
            if torque[weakest] > torque_max_nm[weakest]:
                found = f"{torque[weakest]:.0f} N m on {self.source.joint_names[weakest]}"
                bound = f"torque_max_nm = {torque_max_nm[weakest]:g}: less mass or a shorter lever"
                raise self.source.refused(key, found, f"expected a payload that this joint can carry, {bound}")
