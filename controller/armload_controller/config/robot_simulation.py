"""A robot's simulated twin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_controller.config.robot_source import RobotSource
from armload_controller.config.tables.body_tables import PayloadTable
from armload_core.arrays import FloatArray
from armload_drivers.simulation.plant_spec import PlantSpec, PlantVariant
from armload_identification.model.payload import InertialParameters

HARSH_GAIN_ERROR = 0.02
"""The harsh twin's torque gains are off by up to this share, the same in every run."""
HARSH_SECOND_RUN_FRICTION = 1.03
"""The harsh twin's friction in every run after the first."""


@dataclass(frozen=True, eq=False)
class RobotSimulation:
    """What is simulated in a robot's place; every use but `start_rad` needs a `[simulation]`.

    Attributes:
        source: The robot's file.
        coupling: (n, n) C with q_joint = C q_axis.
    """

    source: RobotSource
    coupling: FloatArray

    @property
    def start_rad(self) -> FloatArray:
        """(n,) where the axes are at first; zeros where there is no twin."""
        table = self.source.tables.simulation
        return np.zeros(self.source.n) if table is None else np.array(table.start_position_rad)

    @property
    def payload_name(self) -> str:
        """Name of the payload that a simulated commissioning mounts.

        Raises:
            ConfigurationError: the file has no simulation.
        """
        return self.source.simulation.payload

    def payload(self, name: str) -> InertialParameters:
        """One of the payloads of `[simulation.payloads]`, in the flange frame.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        return self._table(name).inertial()

    def plant_spec(self, payload: str | None, run: int = 0) -> PlantSpec:
        """The simulated arm.

        Args:
            payload: Name of a payload of `[simulation.payloads]`; None is the empty flange.
            run: Number of the run, so that no two runs share their noise; the harsh twin's friction rises after 0.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        table, chain = self.source.simulation, self.source.chain
        variant = PlantVariant(table.variant)
        harsh = variant is PlantVariant.HARSH
        gains = np.random.default_rng(table.seed)
        return PlantSpec(
            joints=tuple(
                truth.plant_joint(joint, chain.placement[i], chain.axis[i])
                for i, (joint, truth) in enumerate(zip(self.source.tables.joints, table.joints, strict=True))
            ),
            flange=chain.flange,
            gravity_m_s2=chain.gravity_m_s2,
            coupling=self.coupling,
            start_position_rad=np.array(table.start_position_rad),
            seed=table.seed + run,
            payload=None if payload is None else self._table(payload).rigid_body(),
            variant=variant,
            rated_payload=self._table(table.payload).rigid_body(),
            friction_scale=HARSH_SECOND_RUN_FRICTION if harsh and run else 1.0,
            torque_gain_error=gains.uniform(-HARSH_GAIN_ERROR, HARSH_GAIN_ERROR, self.source.n) if harsh else None,
        )

    def _table(self, name: str) -> PayloadTable:
        payloads = self.source.simulation.payloads
        if name not in payloads:
            raise self.source.refused("simulation.payloads", name, f"expected one of {', '.join(sorted(payloads))}")
        return payloads[name]
