"""What a robot's file says of its drives: gains, identities, scales, the bus's load, and warnings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_drivers.cia402.drive_safety import Safety


def test_a_current_becomes_torque_by_gear_ratio_and_torque_constant():
    transmission = load_robot("er50").drives.transmission
    np.testing.assert_allclose(transmission.gain_nm_a[:3], [120.0 * 0.9, 140.0 * 0.95, 110.0 * 0.8])
    assert transmission.coupling[4, 3] == 0.0167


@pytest.mark.parametrize(
    ("line", "key"),
    [("torque_constant_nm_a = 0.9", "torque_constant_nm_a"), ("gear_ratio = 120.0", "gear_ratio")],
)
def test_a_joint_with_half_of_its_gain_is_named(edited, line, key):
    with pytest.raises(ConfigurationError, match="to convert this joint's current to torque") as caught:
        _ = load_robot(edited(line, "#")).drives.transmission
    assert caught.value.key == f"joints[1].{key}"


def test_recordings_of_currents_are_refused_where_a_drive_reports_torque():
    load_robot("er50").drives.require_current_gains("run.mcap")
    torque = load_robot("prbt").drives
    np.testing.assert_array_equal(torque.transmission.gain_nm_a, np.ones(6))
    with pytest.raises(ConfigurationError, match=r"run\.mcap contains motor currents") as caught:
        torque.require_current_gains("run.mcap")
    assert caught.value.key == "joints[1].torque_constant_nm_a"


def test_the_deviation_of_the_gains_is_the_files(edited):
    stated = "[transmission]\ngain_deviation = 0.07\nscale_deviation = 0.02"
    transmission = load_robot(edited("[transmission]", stated)).drives.transmission
    np.testing.assert_array_equal(transmission.covariance, np.diag(np.full(6, 0.07) ** 2))
    assert transmission.scale_deviation == 0.02


def test_without_a_coupling_every_motor_turns_its_own_joint():
    np.testing.assert_array_equal(load_robot("prbt").drives.coupling, np.eye(6))
    assert load_robot("er50").drives.settings.coupling[5, 3] == -0.02


def test_a_joint_without_a_drive_is_named_with_its_number(edited):
    path = Path(edited("[robot]", "[robot]"))
    text = path.read_text()
    begin = text.index("[joints.drive]", text.index("joint_2"))
    path.write_text(text[:begin] + text[text.index("[[joints]]", begin) :])
    with pytest.raises(ConfigurationError, match="one per joint") as caught:
        _ = load_robot(path).drives.settings
    assert caught.value.key == "joints[2].drive"


def test_an_axis_without_a_brake_and_what_was_accepted_are_warned_of(edited):
    assert load_robot("er50").drives.weak_points == ()
    (text,) = load_robot(edited("has_brake = true", "has_brake = false")).drives.weak_points
    assert text.startswith("joint_1 has no brake: it falls")
    accepted = f'has_brake = true\naccept_missing = ["{Safety.MASTER_LOST.key}"]'
    (text,) = load_robot(edited("has_brake = true", accepted, count=2)).drives.weak_points
    assert text == f"joint_1, joint_2: {Safety.MASTER_LOST.lost} (accepted: {Safety.MASTER_LOST.key})"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("torque_limit_in_drive", "set in the drive, and cannot be read"),
        ("second_axis_unused", "nothing watches or stops the further axes"),
    ],
)
def test_what_a_drive_leaves_unwatched_is_warned_of(edited, key, words):
    (text,) = load_robot(edited("has_brake = true", f"has_brake = true\n{key} = true", count=2)).drives.weak_points
    assert text.startswith("joint_1, joint_2: ")
    assert words in text


def test_a_real_arm_needs_the_identity_of_every_drive(edited):
    named = "has_brake = true\nidentity = { vendor_id = 1, product_code = 2 }"
    load_robot(edited("has_brake = true", named, count=6)).drives.require_identities()
    with pytest.raises(ConfigurationError, match="--simulated-drives") as caught:
        load_robot(edited("has_brake = true", named, count=5)).drives.require_identities()
    assert caught.value.key == "joints[6].drive.identity"


def test_listening_needs_the_scale_of_every_drive(edited):
    load_robot("er50").drives.require_scales()
    path = Path(edited("has_brake = true", "has_brake = true\nidentity = { vendor_id = 1, product_code = 2 }", count=6))
    text = path.read_text().replace("counts_per_axis_turn = 18350080", "#", 1)
    path.write_text(text[: text.index("[simulation]")])
    with pytest.raises(ConfigurationError, match="are not queried") as caught:
        load_robot(path).drives.require_scales()
    assert caught.value.key == "joints[2].drive.counts_per_axis_turn"


def test_a_rate_that_the_bus_cannot_carry_is_refused_with_one_that_fits():
    load_robot("er50").drives.require_bus_load()
    with pytest.raises(ConfigurationError, match="this fits: cycle_hz = 250") as caught:
        load_robot("er50").with_bus(cycle_hz=900.0)
    assert caught.value.key == "bus.cycle_hz"
