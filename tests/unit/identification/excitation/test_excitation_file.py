"""The excitation file: round trip, and errors that name the key."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.excitation.excitation_file import (
    format_excitation,
    parse_excitation,
    read_excitation,
    write_excitation,
)
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.limit_margins import LimitMargins
from armload_identification.identification_errors import ExcitationFileError
from tests.smallest_margin import smallest_margin

pytestmark = pytest.mark.pure


def trajectory(seed: int = 0) -> FourierTrajectory:
    rng = np.random.default_rng(seed)
    return FourierTrajectory(0.1, rng.normal(size=3), rng.normal(size=(3, 4)), rng.normal(size=(3, 4)))


DESIGN = {
    "criterion": "a-optimal",
    "cost": 1.25e-3,
    "condition_number": 11.0,
    "seed": 3,
    "restarts": 8,
    "command": 'armload design "er50" --seed 3',
    "armload_version": "0.1.0",
}


def test_a_file_reads_back_bit_for_bit(tmp_path):
    motion = trajectory(5)
    path = tmp_path / "excitation.toml"
    write_excitation(path, Excitation(motion, 3, DESIGN))
    got = read_excitation(path)
    assert np.array_equal(got.trajectory.offset_rad, motion.offset_rad)
    assert np.array_equal(got.trajectory.sin_rad, motion.sin_rad)
    assert np.array_equal(got.trajectory.cos_rad, motion.cos_rad)
    assert (got.periods, got.design, got.periods * got.trajectory.period_s) == (3, DESIGN, 30.0)


def test_a_file_without_a_design_reads_back(tmp_path):
    assert parse_excitation(format_excitation(Excitation(trajectory(), 1))).design == {}


MARGINS = LimitMargins(
    position_rad=np.array([0.1, 0.2, 0.3]),
    velocity_rad_s=np.array([1.0, 2.0, 0.0]),
    acceleration_rad_s2=np.array([4.0, 5.0, 6.0]),
    jerk_rad_s3=np.array([70.0, 80.0, 90.0]),
    torque_nm=np.array([123.4567891, 1e-5, -2.3456789]),
    clearance_m={"floor": 0.25, "link 1 to tool": 0.0301239},
    speed_m_s={"joint 3": 0.4, "tool centre point": 0.12345678},
)


def test_a_file_states_how_the_design_went_and_what_room_is_left():
    got = parse_excitation(format_excitation(Excitation(trajectory(), 3, DESIGN, (0.0212345678, 0.004), MARGINS)))
    assert got.history == (0.021235, 0.004)
    assert got.margins.clearance_m == {"floor": 0.25, "link 1 to tool": 0.0301239}
    assert got.margins.speed_m_s == {"joint 3": 0.4, "tool centre point": 0.123456}
    np.testing.assert_array_equal(got.margins.position_rad, MARGINS.position_rad)
    np.testing.assert_array_equal(got.margins.velocity_rad_s, MARGINS.velocity_rad_s)
    # rounded down to six digits
    np.testing.assert_array_equal(got.margins.torque_nm, [123.456, 1e-5, -2.34568])
    assert smallest_margin(got.margins) == -2.34568


def test_a_file_without_margins_or_history_has_none():
    got = parse_excitation(format_excitation(Excitation(trajectory(), 3, DESIGN)))
    assert (got.history, got.margins) == ((), None)


GOOD = format_excitation(Excitation(trajectory(), 3, DESIGN, (0.02, 0.004), MARGINS))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "base_frequency_hz = 0.1",
            "base_frequency_hz = 0.0",
            ("excitation.base_frequency_hz", "0.0", "greater than 0"),
        ),
        (
            "base_frequency_hz = 0.1",
            'base_frequency_hz = "fast"',
            ("excitation.base_frequency_hz", "'fast'", "number"),
        ),
        (
            "base_frequency_hz = 0.1",
            "base_frequency_hz = nan",
            ("excitation.base_frequency_hz", "nan", "finite"),
        ),
        ("base_frequency_hz = 0.1", "", ("excitation.base_frequency_hz", "missing")),
        ("periods = 3", "periods = 0", ("excitation.periods", "0", "at least 1")),
        ("periods = 3", "periods = true", ("excitation.periods", "True", "whole number")),
        ("periods = 3", "periods = 3\nperoids = 4", ("excitation.peroids", "4", "unknown key", "periods")),
        ("harmonics = 4", "harmonics = 5", ("excitation.sin_rad", "3 lists of 5 finite numbers")),
        ("offset_rad = [", "offset_rad = [0.0, ", ("excitation.sin_rad", "4 lists of 4")),
        ('criterion = "a-optimal"', 'criterion = "best"', ("design.criterion", "'best'", "condition-number")),
        ("seed = 3", "seed = -1", ("design.seed", "-1")),
        ("history = [0.02, ", 'history = ["low", ', ("design.history", "list of finite numbers")),
        ("[margins]\nposition_rad = [0.1, ", "[margins]\nposition_rad = [", ("margins.position_rad", "3 finite")),
        ("clearance_m = {", "clearance = {", ("margins.clearance", "unknown key")),
        ('"floor" = 0.25', '"floor" = "far"', ("margins.clearance_m.floor", "'far'", "number")),
        ("[design]", "[designs]", ("designs", "unknown key")),
        ("[excitation]", "[excitement]", ("excitation", "missing", "table")),
        ("[excitation]", "[excitation", ("not valid TOML",)),
    ],
)
def test_a_bad_file_is_refused_with_file_key_value_and_expectation(tmp_path, old, new, words):
    path = tmp_path / "bad.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ExcitationFileError) as caught:
        read_excitation(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ExcitationFileError, match=r"none\.toml: cannot be read"):
        read_excitation(tmp_path / "none.toml")


def test_no_file_is_left_where_it_would_not_read_back(tmp_path):
    path = tmp_path / "excitation.toml"
    with pytest.raises(ExcitationFileError, match=r"design\.command is missing"):
        write_excitation(path, Excitation(trajectory(), 3, {k: v for k, v in DESIGN.items() if k != "command"}))
    assert not path.exists()
