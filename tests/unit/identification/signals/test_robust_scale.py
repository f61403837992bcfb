"""A scale of normal values that outliers do not affect."""

import numpy as np
import pytest

from armload_identification.signals.robust_scale import deviation_by_median

pytestmark = pytest.mark.pure


def test_it_is_the_standard_deviation_of_normal_values_with_or_without_outliers():
    values = np.random.default_rng(1).normal(scale=[0.2, 3.0], size=(20_001, 2))
    assert deviation_by_median(values) == pytest.approx([0.2, 3.0], rel=0.02)
    values[::50] = 1e3
    assert deviation_by_median(values) == pytest.approx([0.2, 3.0], rel=0.05)
    assert deviation_by_median(values[:, 1]) == pytest.approx(3.0, rel=0.05)
