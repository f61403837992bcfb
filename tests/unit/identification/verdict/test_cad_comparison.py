"""A payload against CAD in the paper's convention, with bodies whose inertia is that of point masses."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.cad_comparison import compare_with_cad, in_papers_convention


def body(points):
    """The body of point masses (kg, m)."""
    mass = np.array([kg for kg, _ in points])
    at = np.array([place for _, place in points], dtype=float)
    center = mass @ at / mass.sum()
    off = at - center
    about_com = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, off, strict=True))
    return InertialParameters.from_center_of_mass(mass.sum(), center, about_com), mass, at


POINTS = [(1.0, (0.1, 0.2, 0.3)), (2.0, (-0.1, 0.05, 0.2)), (0.5, (0.3, -0.2, 0.1)), (0.7, (0.0, 0.1, -0.1))]


def test_the_paper_states_inertia_about_the_origin_with_positive_products():
    model, mass, at = body(POINTS)
    x, y, z = at.T
    expected = [mass.sum(), *(mass @ at / mass.sum())]
    expected += [mass @ (y**2 + z**2), mass @ (x**2 + z**2), mass @ (x**2 + y**2)]
    expected += [mass @ (x * y), mass @ (x * z), mass @ (y * z)]
    np.testing.assert_allclose(in_papers_convention(model), expected, atol=1e-12)


@pytest.fixture
def payload(make_subject):
    return make_subject().payload


def test_errors_are_relative_to_cad(payload):
    cad, _, _ = body(POINTS)
    heavier, _, _ = body([(1.1 * kg, at) for kg, at in POINTS])
    found = compare_with_cad(replace(payload, model=heavier), replace(payload, model=cad))
    np.testing.assert_allclose(found.error, [0.1, 0.0, 0.0, 0.0, *[0.1] * 6], atol=1e-9)
    assert found.frame == payload.frame
    np.testing.assert_allclose(found.estimate[0], 1.1 * found.truth[0])


def test_a_truth_of_zero_has_an_error_of_infinity_or_none(payload):
    ball = InertialParameters.from_center_of_mass(1.0, [0.0, 0.0, 0.0], 0.01 * np.eye(3))
    shifted = InertialParameters.from_center_of_mass(1.0, [0.1, 0.0, 0.0], 0.01 * np.eye(3))
    found = compare_with_cad(replace(payload, model=shifted), replace(payload, model=ball))
    assert found.error[:4].tolist() == [0.0, np.inf, 0.0, 0.0]


def test_inertia_about_the_origin_is_determined_only_with_mass_and_centre(payload):
    determined = np.ones(10, dtype=bool)
    determined[2] = False
    found = compare_with_cad(replace(payload, determined=determined), payload)
    assert found.determined[:4].tolist() == [True, True, False, True]
    assert not found.determined[4:].any()
    assert compare_with_cad(payload, payload).determined.all()


def test_other_frames_are_not_compared(payload):
    with pytest.raises(PayloadFileError, match=r"payload\.frame is 'table'"):
        compare_with_cad(payload, replace(payload, frame="table"))
