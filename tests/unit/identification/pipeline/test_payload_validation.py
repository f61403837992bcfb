"""A payload validated by identifying it again: Pinocchio is the truth, which the verdict must match."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.files.payload_file import format_payload, parse_payload
from armload_identification.identification_errors import PayloadFileError, RecordingError
from armload_identification.model.payload import InertialParameters, Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.payload_validation import judge, validate_runs
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.signal_constants import NominalGain
from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.payload_verdict import known_payload
from armload_identification.verdict.tolerance import Tolerance
from armload_identification.verdict.verdict_text import sentences

pytestmark = pytest.mark.pure

NAMES = tuple(f"axis {number}" for number in range(1, 7))

MADE = Provenance("0", "0" * 64, {})


def exact(transmission):
    return Transmission(transmission.gain_nm_a, transmission.coupling, np.ones(6, dtype=bool))


def changed(payload, factor=1.0, shift_m=(0.0, 0.0, 0.0)):
    mass, inertia = payload.model.mass_kg, payload.model.inertia_about_com
    center = payload.model.center_of_mass_m + shift_m
    return replace(payload, model=InertialParameters.from_center_of_mass(factor * mass, center, factor * inertia))


@pytest.fixture(scope="module")
def payload(pinocchio_arm):
    """Identified from a first pair of runs, and read back from its file."""
    trajectory = pinocchio_arm.trajectory(seed=3)
    pair = [pinocchio_arm.run(trajectory, load, seed=21 + load) for load in (True, False)]
    found = identify_runs(*pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission))
    return parse_payload(format_payload(payload_result(found, MADE)))


@pytest.fixture(scope="module")
def second_pair(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory(seed=8)
    return pinocchio_arm.run(trajectory, True, seed=31), pinocchio_arm.run(trajectory, False, seed=32)


@pytest.fixture(scope="module")
def measured(second_pair, pinocchio_arm):
    return identify_runs(*second_pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission))


def test_the_right_payload_is_right(second_pair, pinocchio_arm, payload):
    result = validate_runs(second_pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission), payload)
    assert result.verdict.outcome is Outcome.RIGHT
    agreement = result.verdict.agreement
    np.testing.assert_allclose(agreement.difference[0], result.measured.parameters.mass_kg - payload.model.mass_kg)
    assert agreement.noticeable_kg < 0.05 * payload.model.mass_kg
    assert (result.left_in_band_nm < 0.05 * result.torque_in_band_nm)[1:3].all()
    np.testing.assert_allclose(result.residual_rms_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.1)


@pytest.mark.parametrize(
    ("factor", "shift_m"),
    [
        (0.5, (0, 0, 0)),
        (0.9, (0, 0, 0)),
        (1.1, (0, 0, 0)),
        (1.0, (0.02, 0, 0)),
        (1.0, (0, 0.02, 0)),
        (1.0, (0, 0, 0.02)),
    ],
)
def test_a_wrong_payload_is_wrong(measured, pinocchio_arm, payload, factor, shift_m):
    result = judge(measured, pinocchio_arm.chain, known_payload(changed(payload, factor, shift_m)), Tolerance())
    assert result.verdict.outcome is Outcome.WRONG


def test_an_error_of_the_mass_is_named_with_its_size_and_the_joints_that_show_it(measured, pinocchio_arm, payload):
    result = judge(measured, pinocchio_arm.chain, known_payload(changed(payload, 0.9)), Tolerance())
    scales = result.verdict.of_payload
    loaded = scales.determined
    assert loaded[1:3].all()
    np.testing.assert_allclose(scales.scale[loaded], 1 / 0.9, atol=0.03)
    assert not result.verdict.of_measured.disagree.any()
    text = " ".join(sentences(result.verdict, NAMES))
    assert text.startswith("The payload's mass is 0.4")
    assert re.search(r"kg \(11\.[0-3] %\) too low\.", text)
    assert "axis 2 1.1" in text
    assert "drive gain" not in text


def test_a_shifted_centre_is_named_with_its_direction(measured, pinocchio_arm, payload):
    result = judge(measured, pinocchio_arm.chain, known_payload(changed(payload, 1.0, (0, 0.03, 0))), Tolerance())
    assert sentences(result.verdict, NAMES)[0].startswith("The payload's centre of mass is off by +")
    assert result.verdict.agreement.difference[2] == pytest.approx(-0.03, abs=0.005)
    assert "The mass agrees: the same payload may have been remounted, moved or turned" in " ".join(
        sentences(result.verdict, NAMES)
    )


def test_a_payload_turned_on_the_flange_is_suggested_with_its_angle(measured, pinocchio_arm, payload):
    x, y, _ = payload.model.center_of_mass_m
    turned = changed(payload, 1.0, (-2.0 * x, -2.0 * y, 0.0))
    result = judge(measured, pinocchio_arm.chain, known_payload(turned), Tolerance())
    text = " ".join(sentences(result.verdict, NAMES))
    assert "remounted, turned by 180 degrees about the flange's z axis" in text
    heavier = judge(measured, pinocchio_arm.chain, known_payload(changed(turned, 0.9)), Tolerance())
    assert "remounted" not in " ".join(sentences(heavier.verdict, NAMES))


def test_a_joint_whose_gain_is_off_is_named(pinocchio_arm, payload):
    """In the second pair drive 3 reports 8 % less: the joints contradict each other, and this one most."""
    trajectory = pinocchio_arm.trajectory(seed=8)
    factor = np.array([1.0, 1.0, 0.92, 1.0, 1.0, 1.0])
    pair = [pinocchio_arm.run(trajectory, load, seed=31 + load) for load in (True, False)]
    pair = [replace(run, current_a=run.current_a * factor) for run in pair]
    result = validate_runs(pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission), payload)
    odd = result.verdict.of_measured
    assert odd.disagree[2]
    assert np.nanargmin(np.where(odd.determined, odd.scale, np.nan)) == 2
    assert result.verdict.of_payload.scale[2] == pytest.approx(0.92, abs=0.02)


def test_nominal_gains_in_common_hardly_widen_the_comparison(second_pair, pinocchio_arm, payload):
    """An error of 2 % in every gain is in both results; only its different effect on the two counts."""
    trajectory = pinocchio_arm.trajectory(seed=3)
    pair = [pinocchio_arm.run(trajectory, load, seed=21 + load) for load in (True, False)]
    found = payload_result(identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission), MADE)
    common = validate_runs(second_pair, pinocchio_arm.chain, pinocchio_arm.transmission, found).verdict.agreement
    none = validate_runs(second_pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission), payload).verdict.agreement
    by_its_own = identify_runs(*second_pair, pinocchio_arm.chain, pinocchio_arm.transmission)
    apart = judge(by_its_own, pinocchio_arm.chain, known_payload(found), Tolerance()).verdict.agreement
    deviation = [agreement.half_width_95[0] for agreement in (none, common, apart)]
    assert deviation[0] < deviation[1] < 0.5 * deviation[2]


def test_a_weighed_mass_leaves_no_common_error_of_the_gains(second_pair, pinocchio_arm):
    """It sets the gains' scale for the validation as well, so that smaller errors are noticed, not greater ones."""
    arm = pinocchio_arm
    trajectory = arm.trajectory(seed=3)
    pair = [arm.run(trajectory, load, seed=21 + load) for load in (True, False)]
    noticeable = []
    for known in (None, KnownPayload(mass_kg=arm.payload.mass_kg)):
        found = identify_runs(*pair, arm.chain, arm.transmission, known=known)
        common = np.sqrt(found.mass_center.gain_covariance.mean())
        common /= NominalGain.common_deviation
        assert common > 0.9 if known is None else common < 0.6
        validation = validate_runs(second_pair, arm.chain, arm.transmission, payload_result(found, MADE))
        assert validation.verdict.outcome is Outcome.RIGHT
        noticeable.append(validation.verdict.agreement.noticeable_kg)
    assert noticeable[1] < noticeable[0]


def test_cannot_tell_comes_with_what_would_show_it(measured, pinocchio_arm, payload):
    """A payload with standard deviations about thirty times as large."""
    known = payload.mass_center
    vague = replace(payload, mass_center=replace(known, measured=1000.0 * known.measured))
    result = judge(measured, pinocchio_arm.chain, known_payload(vague), Tolerance())
    assert result.verdict.outcome is Outcome.CANNOT_TELL
    text = " ".join(sentences(result.verdict, NAMES))
    assert "the smallest error that would be detected" in text
    assert "times the length would detect" in text
    # In the difference of the runs these three show it about equally well.
    assert re.search("The mass is best determined by axis [234]", text)
    hopeless = judge(measured, pinocchio_arm.chain, known_payload(vague), Tolerance(0.001, 0.010))
    assert "No run would detect it" in " ".join(sentences(hopeless.verdict, NAMES))


def test_a_payload_file_of_an_older_version_is_judged_by_its_intervals(measured, pinocchio_arm, payload):
    old = replace(payload, mass_center=None)
    assert "[covariance]" not in format_payload(old)
    again = parse_payload(format_payload(old))
    assert again.mass_center is None
    assert (
        judge(measured, pinocchio_arm.chain, known_payload(changed(again, 0.9)), Tolerance()).verdict.outcome
        is Outcome.WRONG
    )


def test_the_file_keeps_the_covariance(payload, pinocchio_arm):
    again = parse_payload(format_payload(payload))
    for name in ("measured", "freedom", "gain_nm_a", "gain_slope", "gain_covariance"):
        np.testing.assert_array_equal(getattr(again.mass_center, name), getattr(payload.mass_center, name))
    assert again.mass_center.same_gains_as(payload.mass_center)
    np.testing.assert_array_equal(again.mass_center.gain_nm_a, pinocchio_arm.transmission.gain_nm_a)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("degrees_of_freedom = ", "degrees_of_freedom = -", "covariance.degrees_of_freedom .* greater than 0"),
        (r"mass_center = \[\n    \[", "mass_center = [\n    [-", "covariance.mass_center .* no eigenvalue below 0"),
        (r"(?m)^covariance = \[\n    \[[^,]+, ", "covariance = [\n    [", "covariance.gains.covariance"),
        (r"(?m)^covariance = \[\n    \[", "covariance = [\n    [-", "gains.covariance .* no eigenvalue below 0"),
        (r"\[covariance\]", "[covariance]\nsize = 4", "covariance.size .*unknown key"),
    ],
)
def test_a_broken_covariance_is_refused(payload, old, new, message):
    text = format_payload(payload)
    broken, count = re.subn(old, new, text, count=1)
    assert count
    with pytest.raises(PayloadFileError, match=message):
        parse_payload(broken, "payload.toml")


def test_intervals_and_covariance_agree(payload):
    """With equal degrees of freedom, the covariance's intervals are those in the file."""
    half_width = 0.5 * np.diff(payload.interval_95[:4], axis=1)[:, 0]
    deviation = np.sqrt(np.diag(payload.mass_center.total))
    assert ((half_width / deviation > 1.9) & (half_width / deviation < 2.6)).all()


def test_recordings_of_another_arm_are_refused(second_pair, pinocchio_arm, payload):
    head = Transmission(np.ones(3), np.eye(3))
    with pytest.raises(RecordingError, match="has 6 joints, the robot 3"):
        validate_runs(second_pair, pinocchio_arm.chain.head(3), head, payload)


def test_the_residual_is_that_of_single_samples(second_pair, measured, pinocchio_arm, payload):
    """Computed from averages, it equals the RMS over every raw sample of paired periods."""
    loaded, unloaded = second_pair
    result = judge(measured, pinocchio_arm.chain, known_payload(changed(payload, 1.2)), Tolerance())
    raw = pinocchio_arm.transmission.joint_torque(loaded.current_a - unloaded.current_a)
    predicted = np.tile(np.roll(result.predicted_nm, -1, axis=0), (3, 1))
    np.testing.assert_allclose(result.residual_rms_nm, np.sqrt(np.mean((raw - predicted) ** 2, axis=0)), rtol=0.01)


def test_one_period_is_enough_for_a_verdict(pinocchio_arm, payload):
    """Its noise is measured above the motion's band."""
    trajectory = pinocchio_arm.trajectory(seed=8)
    pair = [pinocchio_arm.run(trajectory, load, seed=41 + load, periods=1) for load in (True, False)]
    result = validate_runs(pair, pinocchio_arm.chain, exact(pinocchio_arm.transmission), payload)
    np.testing.assert_allclose(result.signal.noise_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.15)
    assert result.verdict.outcome is Outcome.RIGHT
