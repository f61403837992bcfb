"""The other possible mountings of an arm."""

import numpy as np
import pytest

from armload_identification.model.other_mountings import directions

pytestmark = pytest.mark.pure


def test_the_other_mountings_are_five_of_six_directions():
    found = directions(np.array([0.0, 0.0, -9.81]))
    assert [how.split(",")[0] for how in found] == ["on the ceiling", *["on a wall"] * 4]
    assert found["on the ceiling, gravity_m_s2 = [0.0, 0.0, 9.81]"].tolist() == [0.0, 0.0, 9.81]
    assert found["on a wall, gravity_m_s2 = [0.0, -9.81, 0.0]"].tolist() == [0.0, -9.81, 0.0]
    tilted = directions(9.81 * np.array([0.6, 0.0, 0.8]))
    assert len(tilted) == 6, "of a base between two directions all are others"
    assert len({tuple(way) for way in tilted.values()}) == 6
    assert "on the floor" in next(iter(directions(np.array([9.81, 0.0, 0.0]))))
