"""Prior knowledge: it is kept, it narrows the other intervals, and its own intervals stay honest."""

from __future__ import annotations

import re
from copy import copy

import numpy as np
import pytest

from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.files.payload_file import format_payload, parse_payload
from armload_identification.identification_errors import EstimationError, ModelError, PayloadFileError
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.prior_contradictions import within_ranges
from armload_identification.signals.joint_torque import Transmission
from armload_identification.verdict.cad_comparison import compare_with_cad, in_papers_convention

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def noisy(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    return [pinocchio_arm.run(trajectory, load, seed=400 + load, noise=10.0) for load in (True, False)]


@pytest.fixture(scope="module")
def exact(pinocchio_arm):
    transmission = pinocchio_arm.transmission
    return Transmission(transmission.gain_nm_a, transmission.coupling, np.ones(6, dtype=bool))


def found(arm, pair, transmission, **known):
    return identify_runs(*pair, arm.chain, transmission, known=KnownPayload(**known) if known else None)


@pytest.fixture(scope="module")
def plain(pinocchio_arm, noisy, exact):
    """Without prior knowledge."""
    return found(pinocchio_arm, noisy, exact)


def not_identified_again(prior):
    raise AssertionError("identified again")


def test_a_known_mass_is_kept_and_sharpens_the_centre_of_mass(pinocchio_arm, noisy, exact):
    truth = pinocchio_arm.payload
    plain = found(pinocchio_arm, noisy, exact)
    result = found(pinocchio_arm, noisy, exact, mass_kg=truth.mass_kg)
    assert result.parameters.mass_kg == pytest.approx(truth.mass_kg, rel=1e-4)
    assert result.uncertainty.half_width_95[0] < 1e-4 * truth.mass_kg
    assert (result.uncertainty.half_width_95[1:4] < plain.uncertainty.half_width_95[1:4]).any()
    assert result.parameters.is_physical


def test_a_known_centre_of_mass_is_kept(pinocchio_arm, noisy, exact):
    truth = pinocchio_arm.payload
    result = found(pinocchio_arm, noisy, exact, center_of_mass_m=truth.center_of_mass_m)
    np.testing.assert_allclose(result.parameters.center_of_mass_m, truth.center_of_mass_m, atol=1e-4)
    plain = found(pinocchio_arm, noisy, exact)
    assert result.uncertainty.half_width_95[0] < plain.uncertainty.half_width_95[0]


def test_a_cad_model_fills_in_what_the_data_do_not_tell(pinocchio_arm, noisy, exact):
    truth = pinocchio_arm.payload
    plain = found(pinocchio_arm, noisy, exact)
    result = found(pinocchio_arm, noisy, exact, cad=truth, confidence=0.05)
    assert not plain.uncertainty.determined.all()
    assert result.uncertainty.determined.all()
    error = np.abs(result.uncertainty.values - truth.values)
    assert (error < result.uncertainty.half_width_95).all()


def test_a_cad_model_that_is_wrong_gives_way_to_data(pinocchio_arm, pair, exact):
    """Clean data and a doubtful model: the data win."""
    wrong = InertialParameters(1.3 * pinocchio_arm.payload.theta)
    result = found(pinocchio_arm, pair, exact, cad=wrong, confidence=0.5)
    assert result.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.005)


def test_knowledge_is_a_prior_of_the_stated_width():
    """With hardly any data the result is the model, and the interval has its stated width."""
    cad = InertialParameters.from_center_of_mass(2.0, [0.1, 0.0, 0.05], 0.01 * np.eye(3))
    prior = KnownPayload(cad=cad, confidence=0.1).prior()
    covariance = np.linalg.inv(prior.rows.T @ prior.rows)
    np.testing.assert_allclose(np.linalg.solve(prior.rows, prior.target), cad.theta, rtol=1e-9, atol=1e-12)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.1 * 2.0)


def paper_payload(mass, center, inertia_about_origin, frame="frame 3"):
    """A payload file's content from the paper's numbers: products +int xy dm."""
    signs = np.array([1, 1, 1, -1, -1, -1])
    theta = np.concatenate([[mass], mass * np.asarray(center), signs * inertia_about_origin])
    return PayloadResult(
        frame,
        InertialParameters(theta),
        np.ones(10, dtype=bool),
        np.zeros((10, 2)),
        np.zeros(3),
        np.zeros(3),
        Provenance("0", "", {}),
    )


def test_the_papers_own_table_comes_out():
    """Chen 2016, Table 2: truth, estimate and the error column."""
    cad = paper_payload(9.814, [0.130, 0.940, -0.102], np.array([9.023, 0.353, 9.014, 1.222, -0.133, -0.967]))
    payload = paper_payload(9.323, [0.149, 1.081, -0.125], np.array([7.917, 0.420, 8.281, 1.068, -0.158, -1.105]))
    result = compare_with_cad(payload, cad)
    np.testing.assert_allclose(result.truth[[0, 7, 8, 9]], [9.814, 1.222, -0.133, -0.967])
    published = [5.0, 14.6, 15.0, 22.5, 12.3, 19.0, 8.1, 12.6, 18.8, 14.3]
    np.testing.assert_allclose(100.0 * result.error, published, atol=0.06)
    # The paper's products are +int xy dm: by its numbers I_xy = m cx cy + 0.02.
    assert result.truth[7] == pytest.approx(9.814 * 0.130 * 0.940 + 0.02, abs=0.005)


def test_a_payload_that_is_not_determined_is_not_compared(pinocchio_arm, noisy, exact):
    result = found(pinocchio_arm, noisy, exact)
    file = parse_payload(format_payload(payload_result(result, Provenance("0.1.0", "c" * 64, {}))))
    comparison = compare_with_cad(file, file)
    assert comparison.determined[:4].all()
    assert not comparison.determined[4:].all()
    np.testing.assert_array_equal(comparison.error, 0.0)
    np.testing.assert_allclose(comparison.estimate, in_papers_convention(result.parameters), rtol=1e-8, atol=1e-12)


def test_two_frames_are_not_compared():
    one = paper_payload(1.0, [0, 0, 0.1], np.array([0.1, 0.1, 0.1, 0, 0, 0]))
    other = paper_payload(1.0, [0, 0, 0.1], np.array([0.1, 0.1, 0.1, 0, 0, 0]), "flange")
    with pytest.raises(PayloadFileError, match="the same frame"):
        compare_with_cad(one, other)


def test_a_symmetric_payload_lies_on_the_axis_and_one_that_is_not_is_refused(pinocchio_arm, noisy, exact):
    with pytest.raises(EstimationError, match="symmetric about the flange axis") as refused:
        found(pinocchio_arm, noisy, exact, symmetric=True)
    assert re.search(r"and -1[12]\d\.\d mm off", str(refused.value)), "it is at -120 mm"
    disc = copy(pinocchio_arm)
    disc.payload = InertialParameters.from_center_of_mass(4.2, [0.0, 0.0, 0.09], np.diag([0.03, 0.03, 0.04]))
    pair = [disc.run(disc.trajectory(), load, seed=420 + load, noise=10.0) for load in (True, False)]
    free, known = found(disc, pair, exact), found(disc, pair, exact, symmetric=True)
    np.testing.assert_allclose(known.parameters.center_of_mass_m[:2], 0.0, atol=1e-4)
    assert (known.uncertainty.half_width_95[1:3] < 0.01 * free.uncertainty.half_width_95[1:3]).all()
    reported = known.uncertainty.determined
    error = np.abs(known.uncertainty.values - disc.payload.values)
    assert reported[:4].all()
    assert (error <= known.uncertainty.half_width_95)[reported].all()


def test_a_symmetric_payload_has_no_centre_of_mass_beside_the_axis():
    with pytest.raises(ModelError, match="Give only one of the two"):
        KnownPayload(center_of_mass_m=[0.01, 0.0, 0.1], symmetric=True)


def test_a_range_that_binds_narrows_honestly_and_is_shown(pinocchio_arm, noisy, exact, plain):
    truth = pinocchio_arm.payload
    high = plain.uncertainty.interval_95[0, 1]
    edge = float(plain.uncertainty.values[0])
    result = found(pinocchio_arm, noisy, exact, mass_kg=(edge, 2.0 * high))
    narrowed = result.uncertainty.interval_95[0]
    assert narrowed[0] == edge
    # A half-normal distribution: mean 0.798 deviations from the edge, upper limit 0.798 + 1.96 * 0.603 = 1.98.
    deviation = (high - edge) / 1.96
    assert result.parameters.mass_kg == pytest.approx(edge + 0.798 * deviation, abs=0.01 * deviation)
    assert narrowed[1] == pytest.approx(edge + 1.98 * deviation, abs=0.02 * deviation)
    assert (result.uncertainty.half_width_95[1:4] < 1.02 * plain.uncertainty.half_width_95[1:4]).all()
    assert (np.abs(result.uncertainty.values - truth.values) < 2.0 * result.uncertainty.half_width_95)[1:4].all()
    variance = result.mass_center.measured[0, 0]
    assert np.sqrt(variance) == pytest.approx(0.603 * deviation, rel=0.02)
    assert "the given range of the mass" in result.notes[0]
    written = format_payload(payload_result(result, Provenance("0.1.0", "c" * 64, {})))
    assert "[known_range]" in written
    np.testing.assert_array_equal(parse_payload(written).known_range[0], [edge, 2.0 * high])


def test_a_wide_range_changes_nothing(plain):
    known = KnownPayload(mass_kg=(0.5, 50.0), center_of_mass_m=[(-1, 1), (-1, 1), (-1, 1)])
    assert within_ranges(plain, known, not_identified_again) is plain
    assert payload_result(plain, Provenance("0.1.0", "c" * 64, {})).known_range is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass_kg": (1.0, 2.0)}, r"mass was given as 1 to 2 kg, but from the data it is 4\.\d+ to 4\.\d+ kg"),
        ({"center_of_mass_m": ((0.3, 0.4), 0.0, 0.0)}, "centre of mass's x was given as 300 to 400 mm"),
    ],
)
def test_a_range_that_the_data_contradict_is_refused(plain, given, message):
    with pytest.raises(EstimationError, match=message):
        within_ranges(plain, KnownPayload(**given), not_identified_again)


def test_ranges_that_the_data_contradict_together_are_refused(plain):
    mean, width = plain.uncertainty.values[:4], plain.uncertainty.half_width_95[:4]
    covariance = plain.mass_center.total
    deviation = np.sqrt(np.diag(covariance))
    rarest = np.linalg.eigh(covariance / np.outer(deviation, deviation))[1][:, 0]
    near, far = mean + 0.9 * np.sign(rarest) * width, mean + 3.0 * np.sign(rarest) * width
    mass, *center = [(float(low), float(high)) for low, high in np.sort([near, far], axis=0).T]
    with pytest.raises(EstimationError, match="together contradict the data"):
        within_ranges(plain, KnownPayload(mass_kg=mass, center_of_mass_m=center), not_identified_again)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass_kg": (3.0, 1.0)}, "3 to 1 kg; expected the lower number first"),
        ({"mass_kg": (2.0, 2.0)}, "expected the lower number first"),
        ({"mass_kg": (-1.0, 2.0)}, "expected 0 or more"),
        ({"mass_kg": (1.0, np.inf)}, "expected a number, or a range"),
        ({"mass_kg": (1.0, 2.0, 3.0)}, "expected a number, or a range"),
        ({"mass_kg": -1.0}, "above 0"),
        ({"center_of_mass_m": (0.0, (0.2, 0.1), 0.0)}, "y is 0.2 to 0.1 m; expected the lower"),
        ({"center_of_mass_m": (0.0, (0.1, 0.2))}, "three numbers or ranges"),
        (
            {"center_of_mass_m": (0.0, 0.0, 60.0)},
            r"mass's z is 60.0 m; expected m from the flange, at most 5\. Is it in mm",
        ),
        ({"center_of_mass_m": (0.0, (-60.0, 60.0), 0.1)}, r"mass's y is \(-60.0, 60.0\) m; expected m"),
        ({"center_of_mass_m": ((-0.1, 0.1), 0.0, 0.1), "symmetric": True}, "Give only one of the two"),
    ],
)
def test_knowledge_that_cannot_be_is_refused(given, message):
    with pytest.raises(ModelError, match=message):
        KnownPayload(**given)


def test_a_range_of_the_mass_does_not_set_the_scale():
    assert KnownPayload(mass_kg=(1.0, 3.0)).reference_mass_kg is None
    ranges = KnownPayload(mass_kg=[1.0, 3.0], center_of_mass_m=np.tile([0.0, 0.1], (3, 1)))
    assert ranges.reference_mass_kg is None
    assert KnownPayload(mass_kg=2.0).reference_mass_kg == 2.0
