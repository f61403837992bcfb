"""Inertial parameters, and what is physically possible."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import pose_from_xyz_rpy
from armload_identification.model.payload import (
    DETERMINED_SHARE,
    PSEUDO_INERTIA_BASIS,
    InertialParameters,
    PayloadResult,
    Provenance,
    derived,
    value_scale,
)

pytestmark = pytest.mark.pure

SEEDS = st.integers(0, 100_000)


def masses(seed: int, count: int = 8) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 2.0, count), rng.normal(size=(count, 3)) * 0.2 + rng.normal(size=3)


def body_of(mass_kg: np.ndarray, points_m: np.ndarray) -> InertialParameters:
    """Parameters of point masses, summed by hand."""
    x, y, z = points_m.T
    m = mass_kg
    theta = [m.sum(), m @ x, m @ y, m @ z]
    theta += [m @ (y**2 + z**2), m @ (x**2 + z**2), m @ (x**2 + y**2), -m @ (x * y), -m @ (x * z), -m @ (y * z)]
    return InertialParameters(np.array(theta))


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS)
def test_parameters_of_point_masses_are_their_sums(seed):
    mass_kg, points_m = masses(seed)
    body = body_of(mass_kg, points_m)
    homogeneous = np.column_stack([points_m, np.ones(8)])
    np.testing.assert_allclose(body.pseudo_inertia, homogeneous.T @ np.diag(mass_kg) @ homogeneous, atol=1e-11)
    center = mass_kg @ points_m / mass_kg.sum()
    np.testing.assert_allclose(body.center_of_mass_m, center, atol=1e-13)
    about_center = body_of(mass_kg, points_m - center).inertia_about_origin
    np.testing.assert_allclose(body.inertia_about_com, about_center, atol=1e-11)
    again = InertialParameters.from_center_of_mass(body.mass_kg, center, about_center)
    np.testing.assert_allclose(again.theta, body.theta, atol=1e-11)
    np.testing.assert_allclose(
        InertialParameters.from_pseudo_inertia(body.pseudo_inertia).theta, body.theta, atol=1e-11
    )
    assert body.is_physical
    assert 0 < body.margin < 0.25


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS)
def test_another_frame_sees_the_same_point_masses(seed):
    mass_kg, points_m = masses(seed)
    rng = np.random.default_rng(seed + 1)
    pose = pose_from_xyz_rpy(rng.normal(size=3), rng.uniform(-3, 3, 3))
    moved = body_of(mass_kg, points_m @ pose[:3, :3].T + pose[:3, 3])
    np.testing.assert_allclose(body_of(mass_kg, points_m).transformed(pose).theta, moved.theta, atol=1e-10)


def test_the_papers_identified_payload_is_impossible():
    # Chen 2016, Table 2: its inertia about the centre of mass has the eigenvalues -3.18, -2.83, 0.13
    m, c = 9.323, np.array([0.149, 1.081, -0.125])
    products_positive = [1.068, -0.158, -1.105]  # the paper's sign, +int xy dm
    theta = np.r_[m, m * c, 7.917, 0.420, 8.281, -np.array(products_positive)]
    body = InertialParameters(theta)
    np.testing.assert_allclose(np.linalg.eigvalsh(body.inertia_about_com), [-3.18, -2.83, 0.13], atol=0.01)
    assert not body.is_physical


@pytest.mark.parametrize(
    ("inertia", "possible"),
    [
        ([0.01, 0.01, 0.01], True),
        ([0.01, 0.01, 0.0199], True),
        ([0.01, 0.01, 0.0201], False),  # more than the sum of the other two
        ([0.01, 0.01, -0.01], False),
    ],
)
def test_possible_is_the_triangle_inequality_of_the_principal_moments(inertia, possible):
    body = InertialParameters.from_center_of_mass(2.0, [0.1, -0.2, 0.3], np.diag(inertia))
    assert body.is_physical is possible


def test_a_negative_mass_is_impossible():
    body = InertialParameters(-np.eye(10)[0])
    assert body.margin == -np.inf
    assert not body.is_physical


@pytest.mark.parametrize("theta", [np.zeros(9), np.full(10, np.nan), np.zeros((10, 1))])
def test_anything_but_ten_finite_numbers_is_refused(theta):
    with pytest.raises(ModelError, match=r"theta (has shape .* expected \(10,\)|contains a number that is not finite)"):
        InertialParameters(theta)


def test_a_body_without_mass_has_no_centre():
    with pytest.raises(ModelError, match="no centre of mass"):
        _ = InertialParameters(np.zeros(10)).center_of_mass_m


def test_the_scales_of_the_values_are_those_of_the_payload_file():
    """Determined: within 20 % of m, of 0.1 m, of m (0.1 m)^2."""
    assert pytest.approx([0.4, *3 * [0.02], *6 * [0.004]]) == DETERMINED_SHARE * value_scale(2.0)


def test_the_pseudo_inertia_is_linear_in_the_parameters():
    body = body_of(*masses(3))
    np.testing.assert_allclose(np.tensordot(body.theta, PSEUDO_INERTIA_BASIS, axes=1), body.pseudo_inertia, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_the_derivatives_of_the_ten_values_are_those_of_finite_differences(seed):
    body = body_of(*masses(seed))
    values, slope = derived(body)
    np.testing.assert_array_equal(values, body.values)
    for place, step in enumerate(1e-6 * np.eye(10)):
        ahead, behind = (InertialParameters(body.theta + side * step).values for side in (1.0, -1.0))
        np.testing.assert_allclose(slope[:, place], (ahead - behind) / 2e-6, atol=1e-7)


def result(known, width=0.02):
    body = InertialParameters.from_center_of_mass(2.0, [0.05, 0.0, -0.1], 0.01 * np.eye(3))
    interval = np.where(np.array(known)[:, None], body.values[:, None] + np.array([-0.5, 0.5]) * width, np.nan)
    return PayloadResult("flange", body, np.array(known), interval, np.ones(6), np.ones(6), Provenance("1", "a", {}))


@pytest.mark.parametrize(("unknown", "ready"), [(None, True), (0, False), (3, False), (4, True), (9, True)])
def test_mass_and_centre_are_what_a_feed_forward_requires(unknown, ready):
    assert result([place != unknown for place in range(10)]).feedforward_ready is ready


def test_the_table_has_the_digits_that_the_interval_justifies_and_no_number_for_the_unknown():
    table = result([place != 2 for place in range(10)]).table()
    assert table.title == "Payload in the flange frame, inertia about its centre of mass"
    assert table.headings == ("parameter", "estimate", "95 % interval", "unit")
    assert table.rows[0] == ("mass", "2.000", "1.990 to 2.010", "kg")
    assert table.rows[2] == ("cy", "not determined", "", "m")
    assert [row[3] for row in table.rows] == ["kg", "m", "m", "m", *["kg m2"] * 6]
    assert table.text_columns == (0, 3)
    assert result([True] * 10, width=2e-4).table().rows[0][1:3] == ("2.00000", "1.99990 to 2.00010")


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: InertialParameters.from_center_of_mass(1.0, [0.0, 0.0], np.eye(3)),
            r"centre of mass has .*\(2,\); expected \(3,\)",
        ),
        (
            lambda: InertialParameters.from_center_of_mass(1.0, [0.0] * 3, np.eye(2)),
            r"inertia has shape \(2, 2\); expected \(3, 3\)",
        ),
        (lambda: InertialParameters.from_pseudo_inertia(np.eye(3)), r"shape \(3, 3\); expected \(4, 4\)"),
        (lambda: body_of(*masses(1)).transformed(np.eye(3)), r"pose has shape \(3, 3\); expected \(4, 4\)"),
    ],
)
def test_other_shapes_are_refused(make, text):
    with pytest.raises(ModelError, match=text):
        make()


@pytest.mark.parametrize(
    ("asymmetry", "refused"), [(0.5e-9, ""), (2e-9, "is not symmetric"), (np.nan, "a number that is not finite")]
)
def test_a_tensor_is_symmetric_to_a_billionth(asymmetry, refused):
    inertia = np.eye(3)
    inertia[0, 1] = asymmetry
    with pytest.raises(ModelError, match=refused) if refused else nullcontext():
        InertialParameters.from_center_of_mass(1.0, np.zeros(3), inertia)


def test_a_body_without_matter_has_no_margin():
    assert InertialParameters(np.zeros(10)).margin == -np.inf
    assert not InertialParameters(np.zeros(10)).is_physical
