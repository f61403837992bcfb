"""Runs of an empty arm: a mass whose interval contains 0 and excludes all but a small share of the arm's own torque."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import NothingMounted
from armload_identification.verdict.decision_levels import EmptyArmLevels, FalseAlarms
from armload_identification.verdict.recording_checks.nothing_mounted import refuse_nothing

pytestmark = pytest.mark.pure

PER_KG_NM, OWN_NM = 10.0, 500.0
LEAST_KG = EmptyArmLevels.torque_share * OWN_NM / PER_KG_NM
"""Mass of which the torque is the share of the arm's own up to which it is nothing: 2 kg."""


def refuse(mass_kg, deviation_kg=0.1, moments=(0.0, 0.0, 0.0), floor_kg=0.0, left_nm=0.0):
    """An estimate with almost certain intervals, on an arm of two joints."""
    variance = np.array([deviation_kg, *[0.01] * 3]) ** 2
    plain = SimpleNamespace(
        theta=np.array([mass_kg, *moments, *np.zeros(6)]),
        spread=lambda slope: (variance, np.full(4, 1e6)),
        posterior=SimpleNamespace(residual_nm=left_nm * np.array([[0.6, 0.8], [9.0, 9.0]])),
    )
    regressor = np.zeros((50, 2, 10))
    regressor[..., 0] = PER_KG_NM * np.array([0.6, 0.8])
    arm_nm = np.tile(OWN_NM * np.array([-0.8, 0.6]), (50, 1))
    refuse_nothing(plain, regressor, arm_nm, floor_kg, "the run: ")


@pytest.mark.parametrize("mass_kg", [0.0, 0.19, -0.19, -0.38])
def test_nothing_is_told_with_its_interval(mass_kg):
    with pytest.raises(NothingMounted, match="the run: ") as raised:
        refuse(mass_kg)
    assert raised.value.mass_kg == mass_kg
    assert raised.value.half_width_kg == pytest.approx(0.196, abs=1e-3)


@pytest.mark.parametrize("mass_kg", [0.2, 3.0, -0.4])
def test_a_mass_whose_interval_excludes_0_is_none(mass_kg):
    refuse(mass_kg)


@pytest.mark.parametrize(("most_kg", "told"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize("mass_share", [0.0, 0.5])
def test_an_interval_that_leaves_room_for_a_payload_proves_nothing(most_kg, told, mass_share):
    """The upper end counts, of the mass or of 0 if that is more."""
    deviation = most_kg * LEAST_KG / 1.959964 / (1.0 + mass_share)
    mass_kg = mass_share * 1.959964 * deviation
    if told:
        with pytest.raises(NothingMounted):
            refuse(mass_kg, deviation)
    else:
        refuse(mass_kg, deviation)


def test_of_a_negative_mass_the_half_width_counts():
    deviation = 1.01 * LEAST_KG / 1.959964
    refuse(-0.5 * LEAST_KG, deviation)


@pytest.mark.parametrize(("size", "told"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("axis", range(3))
def test_a_first_moment_is_something_too(size, told, axis):
    moments = np.zeros(3)
    moments[axis] = -size * FalseAlarms.certain_half_widths * 0.01 * 1.959964
    if told:
        with pytest.raises(NothingMounted):
            refuse(0.0, moments=moments)
    else:
        refuse(0.0, moments=moments)


def test_an_error_that_is_not_in_the_estimate_widens_the_interval():
    refuse(0.3)
    with pytest.raises(NothingMounted) as raised:
        refuse(0.3, floor_kg=0.15)
    assert raised.value.half_width_kg == pytest.approx(1.96 * np.hypot(0.1, 0.15), rel=1e-3)


@pytest.mark.parametrize(("share", "told"), [(0.99, True), (1.01, False)])
def test_torque_that_remains_unexplained_may_be_a_payload_with_wrong_gravity(share, told):
    left_nm = share * EmptyArmLevels.left_share * OWN_NM
    if told:
        with pytest.raises(NothingMounted):
            refuse(0.0, left_nm=left_nm)
    else:
        refuse(0.0, left_nm=left_nm)
