"""A simulated twin must fit the joints of its file."""

import msgspec
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.storage.strict_toml import BadValue

PRBT = load_robot("prbt").tables
JOINTS, TWIN = PRBT.joints, PRBT.simulation
LEAST, MOST = JOINTS[2].position_min_rad, JOINTS[2].position_max_rad


def at(position_rad):
    start = list(TWIN.start_position_rad)
    start[2] = position_rad
    return {"start_position_rad": start}


@pytest.mark.parametrize("changes", [{}, at(LEAST), at(MOST), {"payload": sorted(TWIN.payloads)[-1]}])
def test_one_that_fits_is_accepted(changes):
    msgspec.structs.replace(TWIN, **changes).check(JOINTS)


@pytest.mark.parametrize(
    ("changes", "key", "expected"),
    [
        ({"joints": TWIN.joints[:-1]}, "simulation.joints", "expected one per joint, 6 in this file"),
        ({"start_position_rad": [0.0] * 7}, "simulation.start_position_rad", "expected one per joint, 6 in this file"),
        (at(np.nextafter(LEAST, -9.0)), "simulation.start_position_rad", f"between {LEAST} and {MOST}"),
        (at(np.nextafter(MOST, 9.0)), "simulation.start_position_rad", f"{JOINTS[2].name} must be between"),
        ({"payload": "brick"}, "simulation.payload", f"expected one of {', '.join(sorted(TWIN.payloads))}"),
    ],
)
def test_one_that_does_not_is_refused_by_its_key(changes, key, expected):
    with pytest.raises(BadValue, match=expected) as caught:
        msgspec.structs.replace(TWIN, **changes).check(JOINTS)
    assert caught.value.key == key


def test_a_simulated_drive_needs_a_scale():
    unscaled = msgspec.structs.replace(JOINTS[1], drive=msgspec.structs.replace(JOINTS[1].drive, rated_torque_nm=None))
    with pytest.raises(BadValue, match="a simulated drive needs its scale here") as caught:
        TWIN.check([JOINTS[0], unscaled, *JOINTS[2:]])
    assert caught.value.key == "joints[2].drive.rated_torque_nm"


@pytest.mark.parametrize(("drive", "gear", "has_brake", "ratio"), [(None, None, True, 1.0), ("own", 50.0, False, 50.0)])
def test_a_simulated_joint_has_the_limits_of_the_joint_and_the_truth_of_the_twin(drive, gear, has_brake, ratio):
    own = msgspec.structs.replace(JOINTS[1].drive, has_brake=False) if drive else None
    joint = msgspec.structs.replace(JOINTS[1], drive=own, gear_ratio=gear)
    made = TWIN.joints[1].plant_joint(joint, np.eye(4), np.array([0.0, 0.0, 1.0]))
    assert (made.has_brake, made.gear_ratio) == (has_brake, ratio)
    assert (made.name, made.max_torque_nm) == (joint.name, joint.torque_max_nm)
    assert made.torque_noise_nm == joint.torque_noise_nm
    assert made.coulomb_nm == TWIN.joints[1].coulomb_nm
    assert made.link.mass_kg == TWIN.joints[1].link.mass_kg
