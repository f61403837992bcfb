"""Places of an arm's unknowns, which files of calibrations keep."""

import numpy as np
import pytest

from armload_identification.estimation.arm_terms import ARM_TERMS, places_of

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("n", "base"), [(1, 3), (6, 36), (7, 43)])
def test_unknowns_of_the_arm_follow_each_other_without_a_gap(n, base):
    """One of each kind per joint; base parameters of the links; one delay, and a tilt about two axes."""
    places = places_of(np.arange(10 * n).reshape(n, 10) < base)
    assert tuple(places) == ARM_TERMS
    assert [place.start for place in places.values()] == [0, *(place.stop for place in places.values())][:-1]
    sizes = {name: place.stop - place.start for name, place in places.items()}
    assert (sizes.pop("links"), sizes.pop("delay"), sizes.pop("tilt")) == (base, 1, 2)
    assert set(sizes.values()) == {n}
