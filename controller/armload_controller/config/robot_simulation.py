"""A robot's simulated twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armload_controller.config.robot_source import RobotSource
from armload_controller.config.tables.body_tables import PayloadTable
from armload_drivers.simulation.plant_spec import PlantSpec, PlantVariant, RigidBody, ScheduledPayload
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters

NO_PAYLOAD = "none"
"""Name of the empty flange."""
PAYLOAD_FILE = ".toml"
"""Ending by which a payload's name is recognised as a file."""
HARSH_GAIN_ERROR = 0.02
"""Greatest relative error of the harsh twin's torque gains, the same in every run."""
HARSH_SECOND_RUN_FRICTION = 1.03
"""Factor on the harsh twin's friction in every run after the first."""


@dataclass(frozen=True, eq=False)
class RobotSimulation:
    """The simulated twin of a robot; everything except `start_rad` requires a `[simulation]`.

    Attributes:
        source: The robot's file.
        coupling: (n, n) C with q_joint = C q_axis.
    """

    source: RobotSource
    coupling: FloatArray

    @property
    def start_rad(self) -> FloatArray:
        """(n,) initial position of the axes; zeros without a twin."""
        table = self.source.tables.simulation
        return np.zeros(self.source.n) if table is None else np.array(table.start_position_rad)

    @property
    def payload_name(self) -> str:
        """Name of the payload that a simulated commissioning mounts.

        Raises:
            ConfigurationError: the file has no simulation.
        """
        return self.source.simulation_table.payload

    def payload(self, name: str) -> InertialParameters:
        """One of the payloads of `[simulation.payloads]`, in the flange frame.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
        """
        return self._table(name).inertial()

    def mounted(self, name: str) -> RigidBody | None:
        """The body mounted on the flange, by its name on the command line.

        Args:
            name: A payload of `[simulation.payloads]`, the path of a payload file, or `NO_PAYLOAD`.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
            PayloadFileError: the payload file cannot be used.
        """
        if name == NO_PAYLOAD:
            return None
        payloads = self.source.simulation_table.payloads
        if name in payloads:
            return payloads[name].rigid_body()
        if name.endswith(PAYLOAD_FILE):
            from armload_identification.files.payload_file import read_payload

            body = read_payload(Path(name)).model
            return RigidBody(body.mass_kg, body.center_of_mass_m, body.inertia_about_com)
        expected = f"expected one of {', '.join(sorted(payloads))}, {NO_PAYLOAD}, or the path of a payload file (.toml)"
        raise self.source.refused("simulation.payloads", name, expected)

    def plant_spec(self, payload: str | None, run: int = 0, changes: Sequence[ScheduledPayload] = ()) -> PlantSpec:
        """The simulated arm.

        Args:
            payload: Body on the flange, as for `mounted`; None for the empty flange.
            run: Number of the run, so that no two runs share their noise; the harsh twin's friction is higher after 0.
            changes: Payloads mounted and removed later, in order of time.

        Raises:
            ConfigurationError: the file has no simulation, or no payload of that name.
            PayloadFileError: the payload file cannot be used.
        """
        table, chain = self.source.simulation_table, self.source.chain
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
            payload=None if payload is None else self.mounted(payload),
            changes=tuple(changes),
            variant=variant,
            rated_payload=self._table(table.payload).rigid_body(),
            friction_scale=HARSH_SECOND_RUN_FRICTION if harsh and run else 1.0,
            torque_gain_error=gains.uniform(-HARSH_GAIN_ERROR, HARSH_GAIN_ERROR, self.source.n) if harsh else None,
        )

    def _table(self, name: str) -> PayloadTable:
        payloads = self.source.simulation_table.payloads
        if name not in payloads:
            raise self.source.refused("`mounted=`", name, f"expected one of {', '.join(sorted(payloads))}")
        return payloads[name]
