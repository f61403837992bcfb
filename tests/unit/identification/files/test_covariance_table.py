"""`[covariance]` of a payload file: written and read back, and what is no covariance."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.files.covariance_table import covariance_lines, require_covariance
from armload_identification.files.payload_file import format_payload, parse_payload
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.storage.strict_toml import BadValue

MEASURED = np.diag([1e-4, 1e-6, 2e-6, 3e-6]) + 1e-8
KNOWN = MassCenterCovariance(
    MEASURED,
    12.5,
    np.array([10.0, 20.0, 30.0]),
    np.arange(12.0).reshape(4, 3),
    np.diag([1e-4, 2e-4, 3e-4]),
    np.array([[0.0123456, 0.0], [0.0, -1e-5], [0.0, 0.0], [1.0, 2.0]]),
)


@pytest.fixture
def payload(make_subject):
    return make_subject().payload


def read_back(payload, known):
    return parse_payload(format_payload(replace(payload, mass_center=known)), "payload.toml").mass_center


def test_everything_is_read_back(payload):
    found = read_back(payload, KNOWN)
    for name in ("measured", "gain_nm_a", "gain_slope", "gain_covariance"):
        np.testing.assert_array_equal(getattr(found, name), getattr(KNOWN, name))
    assert found.freedom == 12.5
    np.testing.assert_allclose(found.calibration_slope, KNOWN.calibration_slope, rtol=1e-3)


def test_without_gains_and_calibration_their_tables_are_left_out(payload):
    plain = MassCenterCovariance(MEASURED, 7.0)
    table = tomllib.loads("\n".join(covariance_lines(plain)))["covariance"]
    assert set(table) == {"mass_center", "degrees_of_freedom"}
    assert covariance_lines(None) == []
    found = read_back(payload, plain)
    assert found.gain_nm_a.size == 0
    assert found.freedom == 7.0
    slope = KNOWN.calibration_slope
    shared = read_back(payload, replace(plain, calibration_slope=slope))
    np.testing.assert_allclose(shared.held, slope @ slope.T, rtol=1e-2)
    without = replace(KNOWN, calibration_slope=np.zeros((4, 0)))
    assert read_back(payload, without).calibration_slope.shape == (4, 0)
    assert "calibration_slope" not in "\n".join(line for line in covariance_lines(without) if not line.startswith("#"))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"measured": np.eye(3)}, "mass_center"),
        ({"measured": -np.eye(4)}, "mass_center"),
        ({"freedom": 0.0}, "degrees_of_freedom"),
        ({"gain_slope": np.ones((4, 2))}, r"gains\.slope"),
        ({"gain_covariance": np.eye(2)}, r"gains\.covariance"),
        ({"gain_covariance": np.diag([1.0, 1.0, -1.0])}, r"gains\.covariance"),
        ({"calibration_slope": np.ones((3, 2))}, "calibration_slope"),
    ],
)
def test_what_does_not_fit_is_named(payload, changes, key):
    with pytest.raises(PayloadFileError, match=rf"covariance\.{key}"):
        read_back(payload, replace(KNOWN, **changes))


@pytest.mark.parametrize("scale", [1.0, 1e-12, 1e6])
def test_a_covariance_is_symmetric_and_has_no_eigenvalue_below_0_whatever_its_units(scale):
    good = scale * np.array([[4.0, 2.0], [2.0, 1.0]])
    require_covariance("x", good)
    require_covariance("x", np.zeros((2, 2)))
    for wrong in (good + scale * np.array([[0.0, 1e-6], [0.0, 0.0]]), scale * np.array([[1.0, 1.01], [1.01, 1.0]])):
        with pytest.raises(BadValue):
            require_covariance("x", wrong)
    units = np.diag([1e-6, 1e3])
    require_covariance("x", units @ good @ units)
