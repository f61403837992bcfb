"""Units as programs and people write them, and their factors to SI."""

import math

import pytest

from armload_identification.recording.column_units import plain_text, unit_factor, unit_name, units_of

pytestmark = pytest.mark.pure

DEGREE, RPM = math.pi / 180.0, math.pi / 30.0


@pytest.mark.parametrize(
    ("quantity", "factor", "spellings"),
    [
        ("time_s", 1.0, "s sec Seconds Sekunden"),
        ("time_s", 1e-3, "ms msec milliseconds"),
        ("time_s", 1e-6, "us µs μs usec"),
        ("time_s", 1e-9, "ns nanosec"),
        ("position_rad", 1.0, "rad [rad] Radians"),
        ("position_rad", 1e-3, "mrad"),
        ("position_rad", DEGREE, "deg ° º degré Degrees"),
        ("position_rad", 2.0 * math.pi, "rev turns"),
        ("velocity_rad_s", 1.0, "rad/s rad*s^ rads rad_per_s"),
        ("velocity_rad_s", DEGREE, "deg/s °/s deg_per_s"),
        ("velocity_rad_s", RPM, "rpm U/min 1/min tr/min"),
        ("current_a", 1.0, "A amp Ampere"),
        ("current_a", 1e-3, "mA"),
        ("torque_nm", 1.0, "Nm N·m N*m"),
        ("torque_nm", 1e-3, "mNm N·mm"),
        ("torque_nm", 1e3, "kNm"),
    ],
)
def test_units_by_their_spellings(quantity, factor, spellings):
    for spelling in spellings.split():
        assert unit_factor(quantity, spelling) == pytest.approx(factor, rel=1e-12), spelling


@pytest.mark.parametrize(
    ("quantity", "unit"),
    [("time_s", "min"), ("position_rad", "m"), ("torque_nm", "N"), ("current_a", ""), ("time_s", "")],
)
def test_other_units_are_unknown(quantity, unit):
    assert unit_factor(quantity, unit) is None


def test_names_are_those_that_give_the_factor():
    for quantity in ("time_s", "position_rad", "velocity_rad_s", "current_a", "torque_nm"):
        for name in units_of(quantity).split(", "):
            assert unit_name(quantity, unit_factor(quantity, name)) == name
        assert unit_name(quantity, 12.34) == ""


def test_text_loses_its_accents_and_signs():
    assert plain_text("Température °C, µ, τ, θ") == "Temperature  deg C, u, tau, theta"
