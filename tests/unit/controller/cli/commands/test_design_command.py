"""`armload design`: what a short motion is asked for where no option says it."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.analysis import robot_wiggle
from armload_identification.identification_errors import ExcitationError


@pytest.mark.parametrize(
    ("options", "degrees", "share"), [((), 5.0, 0.02), (("--within-deg", "3", "--mass-within", "0.1"), 3.0, 0.1)]
)
def test_a_short_motion_is_of_five_degrees_and_finds_the_mass_to_two_percent(
    armload, monkeypatch, tmp_path, options, degrees, share
):
    asked = []

    def search(robot, request, **_):
        asked.append(request)
        raise ExcitationError("none")

    monkeypatch.setattr(robot_wiggle, "design_wiggle", search)
    armload("design", "er50", "--for", "any-motion", *options, "-o", tmp_path / "wiggle.toml")
    assert (np.degrees(asked[0].within_rad), asked[0].mass_share) == pytest.approx((degrees, share))
    assert asked[0].at_rad == ()
    assert asked[0].speed_m_s is None
