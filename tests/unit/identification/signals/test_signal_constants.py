"""Constants that are mathematics."""

from __future__ import annotations

from math import comb
from statistics import NormalDist

import pytest

from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.model.payload import CONFIDENCE
from armload_identification.signals.signal_constants import SampleNoise

pytestmark = pytest.mark.pure


def test_the_median_of_a_normal_magnitude_is_the_quantile_of_three_quarters():
    assert SampleNoise.median_of_normal == pytest.approx(NormalDist().inv_cdf(0.75), rel=1e-15)


def test_the_half_width_of_a_normal_interval_is_its_quantile():
    assert NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE) == NORMAL_HALF_WIDTH


def test_the_variance_of_a_third_difference_is_the_sum_of_the_squared_binomials():
    assert SampleNoise.third_difference_gain == sum(comb(3, k) ** 2 for k in range(4))
