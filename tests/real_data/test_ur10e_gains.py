"""An arm calibrated on one mounting of a weighed mass and tested on the other: UR10e, measured currents."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.mounted_runs import ArmRuns, MountedRun, WeighedPayload
from armload_identification.model.payload import Provenance
from armload_identification.pipeline.payload_identification import identify_runs

WEIGHED_KG = 2.805
PAIRS = {"a": "", "b": "_b"}


@pytest.fixture(scope="module")
def pairs(ur10e_pair):
    return {name: ur10e_pair(suffix) for name, suffix in PAIRS.items()}


@pytest.fixture(scope="module")
def arms(ur10e, pairs):
    """The arm calibrated from each pair, the minimum for a calibration."""
    return {
        name: calibrate_arm(
            ArmRuns((MountedRun(loaded, "disc"), MountedRun(unloaded, "")), {"disc": WeighedPayload(WEIGHED_KG)}),
            ur10e.chain,
            ur10e.drives.transmission,
            robot=ur10e.name,
            made=Provenance("0", ur10e.sha256, {}),
        )
        for name, (loaded, unloaded) in pairs.items()
    }


@pytest.fixture(scope="module")
def crossed(ur10e, pairs, arms):
    """Each pair, identified with the gains from the other."""
    return {
        name: identify_runs(*pairs[name], ur10e.chain, arms[other].transmission(ur10e.drives.transmission))
        for name, other in (("a", "b"), ("b", "a"))
    }


def test_the_two_calibrations_agree(arms):
    for result in arms.values():
        assert result.determined[1:].all()
        # A payload's weight exerts no torque about a vertical axis.
        assert result.gain_half_width_95[0] > 0.04 * result.gain_nm_a[0]
    one, two = arms["a"], arms["b"]
    apart = np.abs(one.gain_nm_a - two.gain_nm_a)
    assert (apart <= np.hypot(one.gain_half_width_95, two.gain_half_width_95)).all()
    np.testing.assert_allclose(one.body.load_friction[1:3], two.body.load_friction[1:3], atol=0.03)


def test_mass_within_0_7_percent_and_within_its_interval(crossed):
    for result in crossed.values():
        assert result.parameters.mass_kg == pytest.approx(WEIGHED_KG, rel=0.007)
        low, high = result.uncertainty.interval_95[0]
        assert low < WEIGHED_KG < high
        assert result.parameters.is_physical


def test_the_centre_of_mass_is_the_same_but_turned(crossed):
    first, second = (crossed[name].parameters.center_of_mass_m for name in "ab")
    assert np.hypot(*first[:2]) == pytest.approx(np.hypot(*second[:2]), abs=0.002)
    assert first[2] == pytest.approx(second[2], abs=0.002)
    angle = [np.arctan2(c[1], c[0]) for c in (first, second)]
    assert np.degrees(angle[0] - angle[1]) % 360.0 == pytest.approx(184.0, abs=2.0)
