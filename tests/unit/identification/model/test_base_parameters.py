"""Base parameters: a set of columns that is independent and complete, on arms whose base parameters are known."""

import numpy as np
import pytest

from armload_identification.model.base_parameters import base_columns
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import body_regressor

pytestmark = pytest.mark.pure

MASS, MX, MY, MZ = range(4)
IXX, IYY, IZZ = 4, 5, 6
G = np.array([0.0, 0.0, -9.81])


def pendulum(axis, gravity=G):
    return Chain.from_origins(np.zeros((1, 3)), np.zeros((1, 3)), np.array([axis]), np.eye(4), gravity)


def test_a_pendulum_shows_two_moments_and_an_inertia():
    """Its torque is I ddq + (g_x m_y - g_y m_x) and so on: mass and the other inertias are never seen."""
    base = base_columns(pendulum([0.0, 1.0, 0.0]), np.eye(1))
    assert sorted(np.flatnonzero(base)) == [MX, MZ, IYY]


def test_about_the_vertical_only_the_inertia_is_seen():
    base = base_columns(pendulum([0.0, 0.0, 1.0]), np.eye(1))
    assert np.flatnonzero(base).tolist() == [IZZ]


def test_without_gravity_only_the_inertia_is_seen():
    assert base_columns(pendulum([1.0, 0.0, 0.0], np.zeros(3)), np.eye(1)).nonzero()[0].tolist() == [IXX]


def columns_of(chain, states):
    return body_regressor(chain, *states).reshape(-1, 10 * chain.n)


def test_of_six_joints_they_are_independent_and_all_others_combinations_of_them(pinocchio_arm):
    chain = pinocchio_arm.chain
    base = base_columns(chain, np.eye(6))
    assert base.shape == (66,)
    states = np.random.default_rng(5).uniform(-2.0, 2.0, (3, 80, 6))
    links = columns_of(chain, states)
    chosen = links[:, base[:60]]
    assert np.linalg.matrix_rank(chosen) == chosen.shape[1] == np.linalg.matrix_rank(links)
    left = links - chosen @ np.linalg.lstsq(chosen, links)[0]
    assert np.abs(left).max() < 1e-8 * np.abs(links).max()
    scaled = chosen / np.linalg.norm(chosen, axis=0)
    assert np.linalg.cond(scaled) < 1e3, "well-conditioned"


def test_a_rotor_is_seen_where_its_link_does_not_hide_it(pinocchio_arm):
    """Of joint 1 the axis is fixed in space: its link's inertia about it is the rotor's, and stays with the link."""
    rotors = base_columns(pinocchio_arm.chain, np.eye(6))[60:]
    assert not rotors[0]
    assert rotors[2:].all()
    coupling = np.eye(6)
    coupling[0, 1] = 0.3
    assert base_columns(pinocchio_arm.chain, coupling)[60], "now it also turns with joint 2"
