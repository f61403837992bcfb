"""The one probability of false alarms, divided among several tests."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.verdict.decision_levels import FalseAlarms

pytestmark = pytest.mark.pure


@pytest.mark.parametrize("tests", [1, 6, 24])
def test_the_greatest_of_several_sound_values_exceeds_its_limit_with_the_stated_probability(tests):
    greatest = np.abs(np.random.default_rng(0).normal(size=(40_000, tests))).max(axis=1)
    alarms = np.mean(greatest > FalseAlarms.deviations(tests))
    assert alarms == pytest.approx(FalseAlarms.probability, abs=0.0015)
