"""What a tool carries: the whole minus the tool, with the uncertainty of both."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import EstimationError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters, PayloadResult, Provenance
from armload_identification.pipeline.workpiece import Workpiece

TOOL = InertialParameters.from_center_of_mass(3.0, [0.0, -0.01, 0.08], np.diag([0.014, 0.012, 0.006]))
PART = InertialParameters.from_center_of_mass(0.5, [0.01, 0.0, 0.19], np.diag([0.0016, 0.0016, 0.0014]))
BOTH = InertialParameters(TOOL.theta + PART.theta)
DEVIATION = np.array([0.004, 0.0005, 0.0005, 0.001])


def result(body, freedom=np.inf, gains=None):
    covariance = MassCenterCovariance(np.diag(DEVIATION**2), freedom)
    if gains is not None:
        covariance = replace(covariance, **gains)
    interval = body.values[:, None] + np.array([-0.1, 0.1])
    known = np.ones(10, dtype=bool)
    return PayloadResult("flange", body, known, interval, np.ones(6), np.ones(6), Provenance("0", "0", {}), covariance)


def test_the_workpiece_is_the_difference():
    found = Workpiece.of(result(BOTH), result(TOOL))
    np.testing.assert_allclose(found.model.values, PART.values, atol=1e-12)
    written = found.result(result(BOTH))
    assert written.determined.tolist() == [True] * 4 + [False] * 6
    assert np.isnan(written.interval_95[4:]).all()
    np.testing.assert_allclose(written.interval_95[0], [0.5 - found.half_width_95[0], 0.5 + found.half_width_95[0]])


def test_both_covariances_count():
    """Against 20,000 draws of both payloads: mass and first moments of the difference."""
    rng = np.random.default_rng(1)
    found = Workpiece.of(result(BOTH), result(TOOL))
    drawn = []
    for body in (BOTH, TOOL):
        values = body.values[:4] + DEVIATION * rng.normal(size=(20_000, 4))
        drawn.append(np.column_stack([values[:, 0], values[:, :1] * values[:, 1:]]))
    moments = drawn[0] - drawn[1]
    expected = np.column_stack([moments[:, 0], moments[:, 1:] / moments[:, :1]]).std(axis=0)
    np.testing.assert_allclose(found.half_width_95 / 1.959964, expected, rtol=0.03)


def test_an_error_of_gains_that_both_share_counts_once():
    """A gain error scales whole and tool alike, so it only scales the workpiece."""
    scaling = np.zeros((4, 1))

    def scaled(body):
        slope = scaling.copy()
        slope[0] = body.mass_kg
        return {"gain_nm_a": np.ones(1), "gain_slope": slope, "gain_covariance": np.array([[0.02**2]])}

    shared = Workpiece.of(result(BOTH, gains=scaled(BOTH)), result(TOOL, gains=scaled(TOOL)))
    np.testing.assert_allclose(np.sqrt(np.diag(shared.mass_center.held)), [0.02 * 0.5, 0, 0, 0], atol=1e-12)
    others = scaled(TOOL) | {"gain_nm_a": np.full(1, 2.0)}
    apart = Workpiece.of(result(BOTH, gains=scaled(BOTH)), result(TOOL, gains=others))
    assert apart.half_width_95[0] > 4 * shared.half_width_95[0]


def test_an_error_of_the_calibration_that_both_share_counts_once():
    """Two errors, of which the first affects both masses alike and the second only the whole."""
    gains = {"gain_nm_a": np.ones(1), "gain_slope": np.zeros((4, 1)), "gain_covariance": np.eye(1)}
    of_whole, of_tool = np.zeros((2, 4, 2))
    of_whole[0], of_tool[0] = (0.03, 0.01), (0.03, 0.0)
    whole = result(BOTH, gains=gains | {"calibration_slope": of_whole})
    shared = Workpiece.of(whole, result(TOOL, gains=gains | {"calibration_slope": of_tool}))
    np.testing.assert_allclose(np.sqrt(shared.mass_center.held[0, 0]), 0.01, rtol=1e-9)
    other = gains | {"gain_nm_a": np.full(1, 2.0), "calibration_slope": of_tool}
    apart = Workpiece.of(whole, result(TOOL, gains=other)).mass_center.total[0, 0]
    np.testing.assert_allclose(apart, 2 * 0.004**2 + 2 * 0.03**2 + 0.01**2, rtol=1e-9)


def test_a_drift_of_the_day_counts_for_each():
    """Gains that are 1 % off on one day need not be on the other: 3.5 and 3 kg are each off by their own 1 %."""
    slope = np.zeros((4, 1))

    def exact(body):
        slope[0] = body.mass_kg
        return result(
            body, gains={"gain_nm_a": np.ones(1), "gain_slope": slope.copy(), "gain_covariance": 0 * np.eye(1)}
        )

    found = Workpiece.of(exact(BOTH), exact(TOOL), 0.01).mass_center
    np.testing.assert_allclose(found.total[0, 0], 2 * 0.004**2 + 0.035**2 + 0.03**2, rtol=1e-9)


def test_few_degrees_of_freedom_widen_the_interval():
    wide = Workpiece.of(result(BOTH, 4.0), result(TOOL, 4.0)).half_width_95
    assert (wide > 1.15 * Workpiece.of(result(BOTH), result(TOOL)).half_width_95).all()


def test_the_model_is_always_possible():
    """Two wrong inertias whose difference no body has."""
    impossible = InertialParameters(BOTH.theta - np.array([0, 0, 0, 0, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0]))
    found = Workpiece.of(result(impossible), result(TOOL))
    assert found.model.margin > SMALLEST_MARGIN
    np.testing.assert_allclose(found.model.values[:4], PART.values[:4], atol=1e-12)


def test_a_whole_that_is_lighter_than_its_tool_is_refused():
    with pytest.raises(EstimationError, match=r"the whole weighs 3 kg, the tool alone 3\.5 kg: nothing is left"):
        Workpiece.of(result(TOOL), result(BOTH))
