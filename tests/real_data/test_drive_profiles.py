"""The shipped profiles against drives simulated from their manufacturers' descriptions."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from armload_controller.config.drive_profiles import read_profile, shipped_profiles
from armload_controller.config.tables.drive_tables import OF_THE_JOINT, DriveTable
from armload_drivers.bring_up.description_file import read_description
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from tests.ideal_plant import IdealPlant

NO_REACTIONS = ["master_lost", "setpoints_lost", "quick_stop", "fault_reaction"]
LIMIT = {"index": 0x3001, "subindex": 2, "type": "u32", "value": 5000, "meets": "torque_limit"}
PROFILES = {
    "pilz_prbt": ("pilz_prbt_0_1.dcf", {"accept_missing": NO_REACTIONS}),
    "maxon_epos4": ("maxon_epos4_50_15.dcf", {"accept_missing": ["setpoints_lost"], "vendor_settings": [LIMIT]}),
    "elmo_gold": ("elmo_cob4.dcf", {}),
    "roboteq": (
        "roboteq_v80.eds",
        {"accept_missing": NO_REACTIONS, "torque_limit_in_drive": True, "second_axis_unused": True},
    ),
}
"""The description, and the robot file's settings besides the scale."""

ARM = {
    "node_id": 2, "max_torque_permille": 1500, "following_error_rad": 0.2, "has_brake": True,
    "counts_per_axis_turn": 1e6, "rated_torque_nm": 200.0, "rated_current_a": 10.0,
}  # fmt: skip


def test_every_profile_has_a_description():
    assert set(PROFILES) == set(shipped_profiles())


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_brings_its_makers_drive_into_motion(virtual_arm, shared_data, name):
    file, own = PROFILES[name]
    described = read_description(shared_data / "eds" / file)
    profile = read_profile(name, Path(), "arm.toml", "profile")
    table = msgspec.convert({**ARM, **profile.drive.given(), **own}, DriveTable)
    stated = dict(zip(OF_THE_JOINT, ("joint_1", -3.0, 3.0, 2.0, 5.0, None), strict=True))
    drive = table.settings(stated, None)
    found = described.find(drive.temperature.entry("temperature"))
    assert found is not None
    assert found.type is drive.temperature.type
    arm = virtual_arm(
        ArmSettings((drive,), np.eye(1), 0.01, 1_000_000, 0.1, 3),
        traits={2: DriveTraits(description=described)},
        plant=IdealPlant(np.zeros(1)),
    )
    arm.servos.connect()
    assert {finding.of.key for finding in arm.servos.setups[0].safety if finding.way is None} == set(
        own.get("accept_missing", ())
    )
    assert arm.servos.enable().position_rad == pytest.approx(np.zeros(1), abs=1e-4)
