"""The payloads of a robot file, and the spheres that they fill."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.config.robot import load_robot


def test_what_the_file_says_the_arm_carries_keeps_reduced_speed(edited):
    plain = load_robot("prbt")
    carried = plain.controlled_points.carried
    assert [sphere.name for sphere in carried] == ["tool", "expected payload", "heaviest payload"]
    water_m = [(3.0 * mass_kg / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0) for mass_kg in (3.0, 6.0)]
    np.testing.assert_allclose([sphere.radius_m for sphere in carried], [0.11, *water_m])
    np.testing.assert_array_equal([s.center_m for s in carried], [[0.02, -0.01, 0.08]] + 2 * [[0.03, -0.02, 0.08]])
    np.testing.assert_array_equal(plain.motion_constraints.reduced_speed.points.names[-3:], [s.name for s in carried])
    expected, heaviest = plain.payloads.assumed_envelopes
    assert all(word in expected for word in ("[expected_payload]", "0.089 m", "density of water", "envelope_radius_m"))
    assert "[heaviest_payload]" in heaviest
    stated = load_robot(edited("[heaviest_payload]", "[heaviest_payload]\nenvelope_radius_m = 0.25", "prbt"))
    assert stated.controlled_points.carried[-1].radius_m == 0.25
    assert stated.payloads.assumed_envelopes == (expected,)


def test_a_payload_of_less_than_water_is_as_large_as_its_inertia_requires():
    robot = load_robot("er50")
    expected, _ = robot.payloads.assumed_envelopes
    assert all(word in expected for word in ("0.161 m", "its inertia"))
    assert robot.payloads.envelopes[0].radius_m == pytest.approx(np.sqrt(0.510776288 / (2.0 * 9.814)))
    assert load_robot("ur10e").payloads.envelopes == ()
