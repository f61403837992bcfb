"""A payload printed as a table."""

import numpy as np
import pytest

from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("half_width_kg", "estimate"),
    [(0.0994, "2.346"), (0.0996, "2.35"), (0.1, "2.35"), (0.0, "2.34567")],
)
def test_the_mass_has_the_decimals_of_two_digits_of_its_interval(half_width_kg, estimate):
    body = InertialParameters.from_center_of_mass(2.345671, [0.0, 0.0, 0.1], 0.01 * np.eye(3))
    width = np.full(10, 0.01)
    width[0] = half_width_kg
    interval = body.values[:, None] + np.outer(width, [-1.0, 1.0])
    payload = PayloadResult(
        "flange", body, np.ones(10, dtype=bool), interval, np.ones(6), np.ones(6), Provenance("test", "", {})
    )
    assert payload.table().rows[0][1] == estimate
    assert str(payload).splitlines()[2].split() == ["mass", estimate, *payload.table().rows[0][2].split(), "kg"]
