"""A robot's drives: settings for the driver layer, and conversion of current to torque."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from armload_controller.config.drive_profiles import read_profile
from armload_controller.config.robot_source import RobotSource
from armload_controller.config.tables.drive_tables import OF_THE_JOINT
from armload_controller.config.tables.joint_table import JointTable
from armload_drivers.cia402.arm_settings import ArmSettings, Fieldbus
from armload_drivers.cia402.bus_budget import require_room
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.driver_errors import BusOverload, DescriptionError
from armload_identification.float_array import FloatArray
from armload_identification.signals.joint_torque import Transmission

if TYPE_CHECKING:
    from armload_controller.config.tables.profile_table import ProfileFile
    from armload_drivers.cia402.eds_parser import DeviceDescription


@dataclass(frozen=True, eq=False)
class RobotDrives:
    """The drives of one robot.

    Attributes:
        source: The robot's file.
    """

    source: RobotSource

    @cached_property
    def settings(self) -> ArmSettings:
        """Settings for the driver layer.

        Raises:
            ConfigurationError: the robot has no bus, a joint no drive, or a device description cannot be used.
        """
        bus = self.source.bus
        drives = []
        for number, joint in enumerate(self.source.tables.joints, start=1):
            if joint.drive is None:
                raise self.source.refused(f"joints[{number}].drive", None, "an arm on a bus requires one per joint")
            stated = {"joint": joint.name} | {key: getattr(joint, key) for key in OF_THE_JOINT[1:]}
            drives.append(joint.drive.settings(stated, self.descriptions.get(joint.name)))
        return bus.arm_settings(drives, self.coupling)

    @cached_property
    def descriptions(self) -> dict[str, DeviceDescription]:
        """Device description by joint, for joints whose file entry names one.

        Raises:
            ConfigurationError: a description cannot be used.
        """
        found = {}
        for joint, key, name in self._named("description"):
            from armload_drivers.bring_up.description_file import read_description

            try:
                found[joint] = read_description(self.source.folder / name)
            except DescriptionError as error:
                raise self.source.refused(key, name, f"expected a usable EDS or DCF file; {error}") from error
        return found

    @cached_property
    def profiles(self) -> dict[str, ProfileFile]:
        """Drive profile by joint, for joints whose file entry names one.

        Raises:
            ConfigurationError: a profile cannot be used.
        """
        return {
            joint: read_profile(name, self.source.folder, self.source.file, key)
            for joint, key, name in self._named("profile")
        }

    def _named(self, file: str) -> Iterator[tuple[str, str, str]]:
        """Joint, key and file name for every drive that names a file of that kind."""
        for number, joint in enumerate(self.source.tables.joints, start=1):
            name = None if joint.drive is None else getattr(joint.drive, file)
            if name is not None:
                yield joint.name, f"joints[{number}].drive.{file}", name

    @property
    def peculiarities(self) -> tuple[str, ...]:
        """Remarks for the integrator on the products that the joints' profiles name."""
        products = {profile.product.name: profile.product for profile in self.profiles.values()}
        return tuple(f"{name}: {text}" for name, product in products.items() for text in product.peculiarities)

    @property
    def transmission(self) -> Transmission:
        """Conversion of motor currents to joint torques.

        Raises:
            ConfigurationError: a joint's drive reports current but the joint has no torque constant, or a joint has
                only one of gear ratio and torque constant.
        """
        gains = []
        for number, joint in enumerate(self.source.tables.joints, start=1):
            if self._reports_torque(joint):
                gains.append(1.0)  # never applied: these recordings contain torque, see require_current_gains
                continue
            for key in ("gear_ratio", "torque_constant_nm_a"):
                if getattr(joint, key) is None:
                    raise self.source.refused(
                        f"joints[{number}].{key}", None, "required to convert this joint's current to torque"
                    )
            gains.append(float(joint.gear_ratio or 0) * float(joint.torque_constant_nm_a or 0))
        table = self.source.tables.transmission
        if table is None:
            return Transmission(np.array(gains), self.coupling)
        own = [] if table.gain_deviation is None else [table.gain_deviation] * len(gains)
        covariance = np.diag(np.array(own) ** 2)
        return Transmission(
            np.array(gains), self.coupling, covariance=covariance, scale_deviation=table.scale_deviation
        )

    def require_current_gains(self, recording: str) -> None:
        """Refuse a recording of currents if the file lacks the gains to convert them to torque.

        Args:
            recording: The recording, for messages.

        Raises:
            ConfigurationError: naming the first key that is missing.
        """
        for number, joint in enumerate(self.source.tables.joints, start=1):
            if self._reports_torque(joint):
                raise self.source.refused(
                    f"joints[{number}].torque_constant_nm_a",
                    joint.torque_constant_nm_a,
                    f"required, with gear_ratio: {recording} contains motor currents, but this joint is configured to "
                    "report torque",
                )

    @staticmethod
    def _reports_torque(joint: JointTable) -> bool:
        """Whether recordings of a joint contain torque: its drive reports torque, or no motor data is given."""
        if joint.drive is not None:
            return joint.drive.feedback == "torque"
        return joint.gear_ratio is None and joint.torque_constant_nm_a is None

    @property
    def coupling(self) -> FloatArray:
        """(n, n) C with q_joint = C q_axis."""
        table = self.source.tables.transmission
        return np.eye(self.source.n) if table is None or table.coupling is None else np.array(table.coupling)

    @property
    def weak_points(self) -> tuple[str, ...]:
        """Warnings about the drives for the operator, before the arm moves."""
        drives = self.settings.drives
        found = [f"{d.joint} has no brake: it falls when torque is removed" for d in drives if not d.has_brake]
        for of in Safety:
            joints = [drive.joint for drive in drives if of.key in drive.accept_missing]
            if joints:
                found.append(f"{', '.join(joints)}: {of.lost} (accepted: {of.key})")
        told = [drive.joint for drive in drives if drive.torque_limit_in_drive]
        if told:
            found.append(f"{', '.join(told)}: the torque limit is set in the drive, and cannot be read")
        several = [drive.joint for drive in drives if drive.second_axis_unused]
        if several:
            found.append(f"{', '.join(several)}: nothing watches or stops the further axes of these drives")
        return tuple(found)

    def require_identities(self) -> None:
        """Refuse drives whose identity (1018) neither the file nor a device description states.

        Raises:
            ConfigurationError: naming the key.
        """
        for number, drive in enumerate(self.settings.drives, start=1):
            if not drive.is_named:
                raise self.source.refused(
                    f"joints[{number}].drive.identity",
                    None,
                    "a real arm is moved only if the file states the identity of its drives: give vendor_id and "
                    "product_code (`armload drives scan` shows them). If the drives on that bus are those of `armload "
                    "simulate`, add --simulated-drives",
                )

    def require_scales(self) -> None:
        """Refuse drives whose scale the file does not state but leaves to be read from the drive.

        Raises:
            ConfigurationError: naming the key.
        """
        for number, joint in enumerate(self.source.tables.joints, start=1):
            missing = None if joint.drive is None else joint.drive.missing_scale()
            if missing is not None:
                raise self.source.refused(
                    f"joints[{number}].drive.{missing}",
                    None,
                    "required for listening: drives under another master are not queried. The drive holds it in "
                    "608F and 6091, 6076, 6075; its manufacturer's tool shows them",
                )

    def require_bus_load(self) -> None:
        """Refuse a cycle rate whose frames exceed the bus's capacity.

        Raises:
            ConfigurationError: naming a rate that fits.
        """
        if self.settings.fieldbus is Fieldbus.ETHERCAT:
            return  # 100 Mbit/s carry the 20 bytes of a drive 600 times in a millisecond
        try:
            require_room(self.settings)
        except BusOverload as error:
            raise self.source.refused("bus.cycle_hz", self.source.bus.cycle_hz, str(error)) from error
