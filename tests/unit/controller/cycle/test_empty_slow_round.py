"""Mistakes in a robot's file, each made in the torques of a planar arm whose gravity is written down here."""

from __future__ import annotations

import re

import numpy as np
import pytest

from armload_controller.cycle.empty_slow_round import EmptySlowRound

NAMES = ("base", "shoulder", "elbow", "wrist")
G = np.array([0.0, 0.0, -9.81])
MOMENT = np.array([20.0, 8.0, 1.5])
"""First moments of what the last three joints carry, kg m; the base turns about the vertical."""
LEVER_M = np.array([0.5, 0.4])


def directions(position_rad):
    """(N, 3, 3) each link's direction in the vertical plane that the base turns; its derivatives by base and pitch."""
    yaw, pitch = position_rad[:, :1], np.cumsum(position_rad[:, 1:], axis=1)
    up, zero = np.sin(pitch), np.zeros_like(pitch)
    along = np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), up], axis=2)
    by_base = np.stack([-np.cos(pitch) * np.sin(yaw), np.cos(pitch) * np.cos(yaw), zero], axis=2)
    by_pitch = np.stack([-up * np.cos(yaw), -up * np.sin(yaw), np.cos(pitch)], axis=2)
    return along, by_base, by_pitch


def weight_nm(position_rad, gravity_m_s2):
    """Torque against gravity: the derivatives of the potential energy, minus first moments times gravity."""
    _, by_base, by_pitch = directions(position_rad)
    pitched = -MOMENT * (by_pitch @ gravity_m_s2)
    base = -(by_base @ gravity_m_s2) @ MOMENT
    return np.column_stack([base, np.cumsum(pitched[:, ::-1], axis=1)[:, ::-1]])


def flange_nm(position_rad):
    """(N, n, 4) gravity torque of a unit mass at the wrist's axis, and of its first moments in the last link."""
    columns = np.zeros((*position_rad.shape, 4))
    pitch = np.cumsum(position_rad[:, 1:], axis=1)
    for joint in range(2):
        levers = LEVER_M[joint:] * np.cos(pitch[:, joint:2])
        columns[:, 1 + joint, 0] = 9.81 * levers.sum(axis=1)
    for joint in range(3):
        columns[:, 1 + joint, 1] = 9.81 * np.cos(pitch[:, 2])
        columns[:, 1 + joint, 2] = -9.81 * np.sin(pitch[:, 2])
    return columns


POSITION = np.stack(
    [
        0.9 * np.sin(np.linspace(0.0, 2.0 * np.pi, 400)),
        0.4 + 0.7 * np.sin(np.linspace(0.3, 4.0 * np.pi + 0.3, 400)),
        -0.6 + 0.8 * np.sin(np.linspace(1.1, 6.0 * np.pi + 1.1, 400)),
        0.2 + 0.9 * np.sin(np.linspace(2.0, 10.0 * np.pi + 2.0, 400)),
    ],
    axis=1,
)
NOISE_NM = np.array([0.4, 0.5, 0.4, 0.2])


def round_of(position=POSITION, torque=None, gravity=G, file_gravity=G, deviation=0.1):
    """The slow round of an arm that is at `position` with `torque`."""
    torque = weight_nm(position, gravity) if torque is None else torque
    speed = np.gradient(POSITION, axis=0)
    rng = np.random.default_rng(4)
    rubbing = np.array([2.0, 3.0, 2.0, 0.6]) * np.tanh(30.0 * speed / np.abs(speed).max(axis=0))
    noisy = torque + rubbing + NOISE_NM * rng.normal(size=torque.shape) * 0.5
    return EmptySlowRound(
        NAMES, POSITION, noisy, NOISE_NM, weight_nm, file_gravity, np.full(4, deviation), flange_nm(POSITION)
    )


def test_the_weight_of_this_test_is_the_derivative_of_its_energy():
    step = 1e-6
    for gravity in (G, np.array([2.0, -1.0, -9.0])):
        for turn in step * np.eye(4):
            energy = [-(directions(POSITION + sign * turn)[0] @ gravity) @ MOMENT for sign in (1.0, -1.0)]
            slope = (energy[0] - energy[1]) / (2.0 * step)
            np.testing.assert_allclose(weight_nm(POSITION, gravity)[:, turn > 0.0][:, 0], slope, atol=1e-6)


def test_an_arm_as_its_file_says_causes_no_word():
    assert round_of().explanations() == []


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_links_that_are_a_tenth_heavier_are_within_what_is_known(joint):
    torque = weight_nm(POSITION, G)
    torque[:, joint] *= 1.1
    assert round_of(torque=torque).explanations() == []


@pytest.mark.parametrize("joint", [1, 2])
def test_an_axis_that_turns_the_other_way_is_named(joint):
    sign = np.ones(4)
    sign[joint] = -1.0
    best = round_of(torque=sign * weight_nm(sign * POSITION, G)).explanations()[0]
    assert best.text.startswith(f"{NAMES[joint]} seems to turn the other way")
    assert best.gain > best.least_gain


@pytest.mark.parametrize(("joint", "zero_deg"), [(1, 20), (2, -25)])
def test_another_zero_is_named_with_its_place(joint, zero_deg):
    turned = POSITION + np.radians(zero_deg) * np.eye(4)[joint]
    texts = [each.text for each in round_of(torque=weight_nm(turned, G)).explanations()]
    found = [re.search(rf"{NAMES[joint]} seems to stand at ([-+]\d+) degrees", text) for text in texts]
    (degrees,) = [int(match[1]) for match in found if match]
    assert degrees == pytest.approx(zero_deg, abs=4)


@pytest.mark.parametrize("ratio", [0.6, 1.5])
def test_another_gear_ratio_changes_angle_and_torque(ratio):
    factor = np.where(np.arange(4) == 2, ratio, 1.0)
    texts = [each.text for each in round_of(torque=factor * weight_nm(factor * POSITION, G)).explanations()]
    (found,) = [
        re.search(r"elbow seems to turn ([\d.]+) times", text) for text in texts if "elbow seems to turn" in text
    ]
    assert float(found[1]) == pytest.approx(ratio, rel=0.1)


@pytest.mark.parametrize("factor", [0.6, 1.8])
def test_a_torque_of_another_scale_is_named_with_its_factor(factor):
    torque = weight_nm(POSITION, G) * np.where(np.arange(4) == 2, factor, 1.0)
    texts = [each.text for each in round_of(torque=torque).explanations()]
    found = [re.search(r"elbow: its torque seems to be ([\d.]+) times", text) for text in texts]
    (scale,) = [float(match[1]) for match in found if match]
    assert scale == pytest.approx(factor, rel=0.1)


def test_exchanged_joints_are_named_together():
    order = [0, 2, 1, 3]
    torque = weight_nm(POSITION[:, order], G)[:, order]
    best = round_of(torque=torque).explanations()[0]
    assert best.text == "shoulder and elbow seem to be exchanged: exchange their node_id"


@pytest.mark.parametrize("tilt_deg", [10, 30])
def test_a_base_that_is_not_level_is_named_with_its_gravity(tilt_deg):
    tilt = np.radians(tilt_deg)
    truth = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    texts = [each.text for each in round_of(gravity=truth).explanations()]
    (text,) = [text for text in texts if "base" in text and "mounted" in text]
    angle, *vector = map(float, re.findall(r"-?\d+\.?\d*", text.replace("m_s2", "")))
    assert angle == pytest.approx(tilt_deg, abs=1)
    np.testing.assert_allclose(vector, truth, atol=0.4)


def test_something_on_the_flange_is_the_empty_text():
    torque = weight_nm(POSITION, G) + flange_nm(POSITION) @ [3.0, 0.2, 0.1, 0.0]
    best = round_of(torque=torque).explanations()[0]
    assert best.text == ""


def test_a_joint_about_the_vertical_shows_nothing():
    sign = np.array([-1.0, 1.0, 1.0, 1.0])
    assert round_of(torque=sign * weight_nm(sign * POSITION, G)).explanations() == []


def test_the_best_comes_first_and_only_what_explains_nearly_as_much_follows():
    found = round_of(torque=weight_nm(POSITION + np.array([0.0, 0.35, 0.0, 0.0]), G)).explanations()
    gains = [each.gain for each in found]
    assert gains == sorted(gains, reverse=True)
    assert min(gains) >= 0.8 * max(gains)
