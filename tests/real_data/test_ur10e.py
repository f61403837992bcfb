"""A weighed payload on a real arm: 2.805 kg on a UR10e, from its motor currents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.files.payload_file import format_payload
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.payload import Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs

WEIGHED_KG = 2.805


def test_pair_a_is_weighed_and_its_inertia_is_not_printed(ur10e_identified):
    result = ur10e_identified("")
    assert result.parameters.mass_kg == pytest.approx(WEIGHED_KG, rel=0.015)
    x, y, z = result.parameters.center_of_mass_m
    assert z == pytest.approx(0.05, abs=0.01)
    assert np.hypot(x, y) == pytest.approx(0.17, abs=0.01)
    assert result.uncertainty.determined.tolist() == [True] * 4 + [False] * 6
    low, high = result.uncertainty.interval_95[0]
    assert low < WEIGHED_KG < high
    assert not result.plain_parameters.is_physical
    assert result.parameters.is_physical
    assert (result.signal.mismatch_rad < 2e-4).all()
    text = format_payload(payload_result(result, Provenance("0.1.0", "", {}))).split("[model]")[0]
    assert "mass_kg = 2." in text
    assert "inertia_kg_m2 = { ixx = false" in text
    assert "inertia_kg_m2 = { ixx = 0" not in text
    assert any("gains are nominal" in note for note in result.notes)


@pytest.mark.long
def test_pair_b_is_weighed_and_its_garbage_is_counted(ur10e_identified):
    result = ur10e_identified("_b")
    assert result.parameters.mass_kg == pytest.approx(WEIGHED_KG, rel=0.04)
    loaded, unloaded = result.sources
    assert loaded.rows_read == 6107
    assert dict(loaded.reasons) == {"impossible value": 4, "time out of range": 5, "truncated last row": 1}
    assert unloaded.rows_dropped == 0
    assert any("10 of 6107 rows dropped" in note for note in result.notes)


@pytest.mark.long
def test_the_remounted_payload_is_turned_about_the_flange_axis(ur10e_identified):
    first, second = (ur10e_identified(suffix).parameters for suffix in ("", "_b"))
    angle = [np.arctan2(c[1], c[0]) for c in (first.center_of_mass_m, second.center_of_mass_m)]
    assert np.degrees(angle[0] - angle[1]) % 360.0 == pytest.approx(184.0, abs=3.0)


@pytest.mark.parametrize("suffix", ["", "_b"])
def test_the_gain_of_joint_5_is_found_to_be_off_and_no_interval_hides_it(ur10e_identified, suffix):
    """From all runs of this arm it is 4.8 % below nominal; the centre of mass lies 170 mm from the flange axis and
    43 mm along it."""
    result = ur10e_identified(suffix)
    if not suffix:  # pair b contradicts it by four standard deviations, as many as a contradiction needs
        assert result.gains.contradicted[4]
        assert abs(result.gains.log_gain[4] - np.log(0.952)) < result.gains.half_width_95[4]
        assert any("gain of joint 5" in note for note in result.notes)
    assert result.gains.log_gain[4] - result.gains.half_width_95[4] < np.log(0.952)
    low, high = result.uncertainty.interval_95[0]
    assert low < WEIGHED_KG < high
    x, y, z = result.parameters.center_of_mass_m
    width = result.uncertainty.half_width_95[1:4]
    # Calibrations from different sets of runs give 169.1 to 170.6 mm.
    assert 0.1691 - np.hypot(width[0], width[1]) < np.hypot(x, y) < 0.1706 + np.hypot(width[0], width[1])
    assert abs(z - 0.0435) < width[2]


@pytest.mark.parametrize("suffix", ["", pytest.param("_b", marks=pytest.mark.long)])
@pytest.mark.parametrize("joint", range(6))
def test_a_flipped_sign_is_found_in_both_runs(ur10e, ur10e_pair, suffix, joint):
    sign = np.where(np.arange(6) == joint, -1.0, 1.0)
    runs = [replace(run, current_a=run.current_a * sign) for run in ur10e_pair(suffix)]
    with pytest.raises(RecordingError, match=f"loaded.* and .*unloaded.*: joint {joint + 1} .* is flipped"):
        identify_runs(*runs, ur10e.chain, ur10e.drives.transmission)


@pytest.mark.long
def test_a_wrong_weighed_mass_is_refused_with_both_numbers(ur10e, ur10e_pair):
    with pytest.raises(EstimationError, match=r"weighed mass 5 kg contradicts the data: without it, the mass is 2\.82"):
        identify_runs(*ur10e_pair(""), ur10e.chain, ur10e.drives.transmission, known=KnownPayload(mass_kg=5.0))


@pytest.mark.parametrize("joints", [(0, 1), pytest.param((4, 5), marks=pytest.mark.long)])
def test_exchanged_joints_are_named(ur10e, ur10e_pair, joints):
    order = np.arange(6)
    order[list(joints)] = joints[::-1]
    runs = [
        replace(
            run,
            position_rad=run.position_rad[:, order],
            velocity_rad_s=run.velocity_rad_s[:, order],
            current_a=run.current_a[:, order],
        )
        for run in ur10e_pair("")
    ]
    with pytest.raises(
        RecordingError, match=f"all columns of joints {joints[0] + 1} and {joints[1] + 1} are exchanged"
    ):
        identify_runs(*runs, ur10e.chain, ur10e.drives.transmission)
