"""What is known of a payload beforehand, against intervals that a test decides: refused, noted, or used."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.pipeline.prior_contradictions import (
    contradicted,
    identified_knowing,
    truncated_moments,
    within_ranges,
)

pytestmark = pytest.mark.pure

WIDE = (-1.0, 1.0)


@dataclass
class Intervals:
    """Mass (kg) and centre of mass (m) with half widths; within known limits."""

    values: np.ndarray
    half_width_95: np.ndarray
    limits: np.ndarray | None = None

    @property
    def interval_95(self):
        ends = self.values[:, None] + self.half_width_95[:, None] * [-1.0, 1.0]
        return ends if self.limits is None else np.clip(ends, self.limits[:, :1], self.limits[:, 1:])


@dataclass
class Found:
    """An identification."""

    uncertainty: Intervals
    notes: tuple = ()
    mass_center: object = field(init=False)

    def __post_init__(self):
        widths = np.where(np.isinf(self.uncertainty.half_width_95[:4]), 1.0, self.uncertainty.half_width_95[:4])
        correlated = 0.5 * (np.eye(4) + 1.0)
        self.mass_center = SimpleNamespace(total=correlated * np.outer(widths, widths) / NORMAL_HALF_WIDTH**2)

    def with_notes(self, note):
        return Found(self.uncertainty, (note, *self.notes))


def found(mass_kg=4.0, center_m=(0.0, 0.0, 0.1), half_kg=0.2, half_m=0.01):
    values = np.array([mass_kg, *center_m, *np.zeros(6)])
    half = np.array([half_kg, *np.broadcast_to(half_m, 3), *np.ones(6)])
    return Found(Intervals(values, half))


def knowing(known, *results):
    """Identifies with what is known; the results are those of the priors that are asked for in turn."""
    given = iter(results)
    priors = []

    def identified(prior):
        priors.append(prior)
        result = next(given)
        if isinstance(result, Exception):
            raise result
        return result

    return identified_knowing(known, identified), priors


# A weighed mass --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("off_kg", [0.0, 0.199, -0.199])
def test_a_mass_within_its_interval_causes_no_word(off_kg):
    result, priors = knowing(KnownPayload(mass_kg=4.0 + off_kg), found(), found())
    assert result.notes == ()
    assert len(priors) == 2


@pytest.mark.parametrize("off_kg", [0.21, -0.39])
def test_a_mass_that_may_be_outside_by_chance_is_noted(off_kg):
    result, _ = knowing(KnownPayload(mass_kg=4.0 + off_kg), found(), found())
    (note,) = result.notes
    assert note.startswith(f"The weighed mass {4.0 + off_kg:g} kg is outside the interval of the data")
    assert "without it, the mass is 4 +- 0.2 kg (95 %)" in note


@pytest.mark.parametrize("off_kg", [0.41, -0.41])
def test_a_mass_that_is_far_outside_is_refused(off_kg):
    with pytest.raises(EstimationError, match=r"contradicts the data: without it, the mass is 4 \+- 0\.2 kg"):
        knowing(KnownPayload(mass_kg=4.0 + off_kg), found())


def test_an_empty_arm_contradicts_a_mass_and_what_is_not_determined_does_not():
    with pytest.raises(EstimationError, match=r"weighed mass 4 kg contradicts the data\. Without it: nothing"):
        knowing(KnownPayload(mass_kg=4.0), NoPayloadMass("nothing", 0.0, 0.1))
    result, _ = knowing(KnownPayload(mass_kg=0.05), NoPayloadMass("nothing", 0.0, 0.1), found())
    assert result.notes == ()
    result, _ = knowing(KnownPayload(mass_kg=40.0), EstimationError("too little motion"), found())
    assert result.notes == ()


# Symmetry --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("y_m", "refused"), [(0.019, False), (-0.019, False), (0.021, True), (-0.021, True)])
def test_a_symmetry_is_refused_if_the_centre_is_far_off_the_axis(y_m, refused):
    known = KnownPayload(symmetric=True)
    if refused:
        with pytest.raises(EstimationError, match=re.escape(f"lies +0.0 and {1e3 * y_m:+.1f} mm off that axis")):
            knowing(known, found(center_m=(0.0, y_m, 0.1)))
    else:
        knowing(known, found(center_m=(0.0, y_m, 0.1)), found())
    knowing(known, found(center_m=(0.0, 0.0, 0.5)), found())


# Ranges ----------------------------------------------------------------------------------------------------------


def ranged(known, free, narrowed=None):
    priors = []

    def identified(prior):
        priors.append(prior)
        return narrowed or free

    return within_ranges(free, known, identified), priors


@pytest.mark.parametrize("mass_kg", [(3.8, 4.2), (3.0, 5.0)])
def test_a_range_that_contains_the_interval_changes_nothing(mass_kg):
    free = found()
    result, priors = ranged(KnownPayload(mass_kg=mass_kg), free)
    assert result is free
    assert priors == []


@pytest.mark.parametrize("mass_kg", [(4.21, 5.0), (3.0, 3.79)])
def test_a_range_outside_the_interval_is_refused(mass_kg):
    with pytest.raises(EstimationError, match=r"the mass was given as .* but from the data it is 3\.8 to 4\.2 kg \(95"):
        ranged(KnownPayload(mass_kg=mass_kg), found())


@pytest.mark.parametrize(
    ("mass_kg", "kept"), [((3.9, 5.0), (3.9, 4.2)), ((3.0, 4.1), (3.8, 4.1)), ((3.9, 4.1), (3.9, 4.1))]
)
def test_a_range_that_cuts_the_interval_is_active_and_noted(mass_kg, kept):
    result, priors = ranged(KnownPayload(mass_kg=mass_kg), found())
    (note,) = result.notes
    assert f"the given range of the mass, {mass_kg[0]:g} to {mass_kg[1]:g} kg, is active" in note
    assert f"without it the 95 % interval is 3.8 to 4.2 kg, with it {kept[0]:g} to {kept[1]:g} kg." in note
    np.testing.assert_allclose(result.uncertainty.limits[0], mass_kg)
    assert np.isinf(result.uncertainty.limits[1:]).all()
    assert len(priors) == 1


def test_a_coordinate_is_said_in_millimetres():
    result, _ = ranged(KnownPayload(center_of_mass_m=(WIDE, WIDE, (0.095, 0.2))), found())
    (note,) = result.notes
    assert "centre of mass's z, 95 to 200 mm, is active: without it the 95 % interval is 90 to 110 mm" in note
    assert np.isinf(result.uncertainty.limits[0]).all()


def test_a_range_that_becomes_active_with_another_one_is_noted_too():
    """With the mass cut, the centre's interval moves beyond its own range."""
    known = KnownPayload(mass_kg=(3.9, 5.0), center_of_mass_m=(WIDE, WIDE, (0.08, 0.12)))
    moved = found(center_m=(0.0, 0.0, 0.115))
    result, _ = ranged(known, found(), moved)
    assert [note.split(",")[0] for note in result.notes] == [
        "the given range of the mass",
        "the given range of the centre of mass's z",
    ]


def test_ranges_that_exclude_each_other_are_refused_together():
    """Mass and centre are correlated: both at their far ends are not possible at once."""
    free = found()
    widths = np.array([0.2, 0.01, 0.01, 0.01]) / NORMAL_HALF_WIDTH
    correlated = np.eye(4)
    correlated[0, 3] = correlated[3, 0] = -0.999
    free.mass_center = SimpleNamespace(total=correlated * np.outer(widths, widths))
    known = KnownPayload(mass_kg=(4.19, 5.0), center_of_mass_m=(WIDE, WIDE, (0.109, 0.2)))
    with pytest.raises(EstimationError, match=r"together contradict the data: the mass .* and the centre of"):
        ranged(known, free)


def test_what_the_data_do_not_determine_is_uniform_in_its_range():
    free = found(half_m=(0.01, 0.01, np.inf))
    result, (prior,) = ranged(
        KnownPayload(center_of_mass_m=(WIDE, WIDE, (0.3, 0.5))), free, found(center_m=(0.0, 0.0, 0.4))
    )
    assert prior is not None
    assert result.uncertainty.limits[3].tolist() == [0.3, 0.5]


def test_a_mass_cut_at_its_middle_is_half_normal_and_so_is_what_is_correlated_with_it():
    """Mean sqrt(2 / pi) and variance 1 - 2 / pi of a deviation."""
    covariance = np.diag([0.04, 1e-8, 1e-8, 1e-8])
    limits = np.tile([-np.inf, np.inf], (4, 1))
    limits[0, 0] = 4.0
    mean, spread = truncated_moments(np.array([4.0, 0.01, 0.02, 0.1]), covariance, limits)
    assert mean[0] == pytest.approx(4.0 + 0.2 * np.sqrt(2.0 / np.pi), abs=1e-3)
    assert spread[0, 0] == pytest.approx(0.04 * (1.0 - 2.0 / np.pi), rel=0.01)
    np.testing.assert_allclose(np.diag(spread)[1:], 1e-8, rtol=0.2)
    np.testing.assert_allclose(mean[1:], [0.01, 0.02, 0.1], atol=1e-4)
    np.testing.assert_allclose(spread, spread.T)


@pytest.mark.parametrize(("away", "out"), [(1.95, False), (1.97, True)])
def test_a_limit_contradicts_beyond_the_95_percent_ellipsoid(away, out):
    """Of one quantity at 1.96 deviations, of two at 2.448."""
    one = np.array([[4.0]]), np.array([[4.0 + away, 9.0]])
    assert contradicted(one[0][0], np.eye(1), one[1]) is out
    both = np.array([[away, 9.0], [np.sqrt(2.448**2 - 1.96**2), 9.0]])
    assert contradicted(np.zeros(2), np.eye(2), both) is out
