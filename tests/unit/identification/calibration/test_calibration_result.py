"""A calibration: for which arm it is, and what is known of the arm with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from armload_identification.calibration.calibration_result import DETERMINED_WITHIN
from armload_identification.estimation.arm_terms import GAIN
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.recording.reading_options import Effort
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.reversals import TURN_OVER

pytestmark = pytest.mark.pure


def test_the_residual_of_a_known_arm_is_that_of_its_joints(result, pinocchio_arm, nominal):
    """A calibration holds that of axes with nominal gains; joints 5 and 6 are a differential wrist here."""
    coupling = np.eye(6)
    coupling[4:, 4:] = [[0.5, 0.5], [0.5, -0.5]]
    nominal = Transmission(nominal.gain_nm_a, coupling)
    found = replace(
        result,
        body=replace(result.body, coupling=coupling),
        noise_nm=np.array([1.0, 2.0, 0.5, 0.2, 0.3, 0.9]),
        gain_nm_a=1.2 * nominal.gain_nm_a,
    )
    known = found.known_arm
    axes = np.random.default_rng(1).normal(size=(100_000, 6))
    for axis_nm, joint_nm in (
        (found.noise_nm, known.noise_nm),
        (found.level_nm, known.level_nm),
    ):
        torque = found.transmission(nominal).joint_torque(axes * axis_nm / nominal.gain_nm_a)
        np.testing.assert_allclose(joint_nm, np.sqrt(np.mean(torque**2, axis=0)), rtol=0.01)


def test_another_arm_is_refused(result, pinocchio_arm):
    chain = pinocchio_arm.chain
    result.require_arm(chain, pinocchio_arm.transmission.coupling)
    hung = Chain(chain.placement, chain.axis, chain.flange, -chain.gravity_m_s2)
    with pytest.raises(ModelError, match="mounted differently"):
        result.require_arm(hung, pinocchio_arm.transmission.coupling)
    with pytest.raises(ModelError, match="different motor coupling"):
        result.require_arm(chain, np.eye(6))


# Numbers that follow from those of a calibration -----------------------------------------------------------------


@pytest.fixture
def chosen(calibration):
    """A calibration with chosen gains and friction, and independent unknowns."""
    n = calibration.n
    body = replace(
        calibration.body,
        coulomb_nm=np.full(n, 4.0),
        viscous_nm_s_rad=np.full(n, 3.0),
        root_nm=np.full(n, 2.0),
        reversal_speed_rad_s=2.0 * TURN_OVER * np.full(n, 0.25),
    )
    deviation = np.linspace(0.01, 0.05, len(calibration.covariance))
    return replace(
        calibration,
        body=body,
        effort=Effort.CURRENT,
        gain_nm_a=np.full(n, 20.0),
        nominal=np.full(n, 10.0),
        covariance=np.diag(deviation**2),
        drift=np.array([[0.3] * n, [0.4] * n, [0.1] * n]),
    )


def test_a_known_arm_is_held_a_hundred_times_as_firmly_as_its_errors(chosen):
    """With correlated errors; only the gains' are of opposite sign."""
    root = np.diag(np.sqrt(np.diag(chosen.covariance))) @ np.tri(len(chosen.covariance))
    known = replace(chosen, covariance=root @ root.T).known_arm.known
    turn = np.ones(len(root))
    turn[chosen.place(GAIN)] = -1.0
    np.testing.assert_allclose(
        known.precision @ (turn[:, None] * (root @ root.T) * turn), 1e4 * np.eye(len(root)), atol=1e-3
    )


def test_load_dependent_friction_of_a_cold_arm_differs_by_a_fifth(chosen):
    body = replace(chosen.body, load_friction=np.linspace(-0.02, 0.1, chosen.n))
    known = replace(chosen, body=body).known_arm
    np.testing.assert_allclose(known.load_friction_spread, 0.2 * np.abs(body.load_friction))


def test_friction_is_that_at_half_the_greatest_speed(chosen):
    """0.25 rad/s: 4 + 3 * 0.25 + 2 * 0.5."""
    np.testing.assert_allclose(chosen.middle_speed_rad_s, 0.25)
    np.testing.assert_allclose(chosen.friction_nm, 5.75)
    of = chosen.deviation
    expected = np.sqrt(of("coulomb") ** 2 + (0.25 * of("viscous")) ** 2 + (0.5 * of("root")) ** 2)
    np.testing.assert_allclose(chosen.friction_deviation_nm, expected)


def test_friction_changes_from_run_to_run(chosen):
    changes = np.array([[0.1] * 6, [0.8] * 6, [9.0] * 6])
    run = structs.replace(chosen.runs[0], friction_changes=changes)
    np.testing.assert_allclose(chosen.friction_change_nm(run), 0.1 + 0.25 * 0.8)
    np.testing.assert_allclose(chosen.usual_change_nm, np.hypot(0.3, 0.25 * 0.4))
    spread = chosen.friction_spread
    assert (spread[:2] > chosen.drift[:2]).all(), "a cold arm on another day"
    np.testing.assert_allclose(spread[2], chosen.drift[2])
    np.testing.assert_allclose((spread[0] ** 2 - 0.3**2) / (spread[1] ** 2 - 0.4**2), (5.0 / 3.0) ** 2)


def test_a_gain_is_determined_if_its_interval_is_narrow(chosen):
    deviation = np.sqrt(np.diag(chosen.covariance)[:6])
    np.testing.assert_allclose(chosen.gain_deviation, deviation)
    np.testing.assert_allclose(chosen.gain_half_width_95, 1.959964 * deviation * 20.0, rtol=1e-6)
    for share, determined in ((0.99, True), (1.01, False)):
        covariance = chosen.covariance.copy()
        covariance[2, 2] = (share * DETERMINED_WITHIN / 1.959964) ** 2
        assert replace(chosen, covariance=covariance).determined[2] == determined


def test_commands_are_scaled_by_what_the_gains_are_short_of(chosen):
    """Twice the nominal gain gives twice the torque: half is commanded, to the axes."""
    coupling = np.eye(6)
    coupling[5, 4] = 0.3
    gains = replace(chosen, gain_nm_a=np.array([10.0, 10.0, 10.0, 10.0, 20.0, 10.0]))
    joint_nm = np.arange(1.0, 7.0)
    commanded = joint_nm @ gains.commanded(coupling)
    axes = commanded @ coupling
    expected = joint_nm @ coupling * np.array([1.0, 1.0, 1.0, 1.0, 0.5, 1.0])
    np.testing.assert_allclose(axes, expected)


@pytest.mark.parametrize("effort", Effort)
def test_its_gains_replace_the_nominal_ones(chosen, pinocchio_arm, effort):
    found = replace(chosen, effort=effort).transmission(pinocchio_arm.transmission)
    changed = found.gain_nm_a if effort is Effort.CURRENT else found.torque_gain
    np.testing.assert_array_equal(changed, chosen.gain_nm_a)
    if effort is Effort.TORQUE:
        np.testing.assert_array_equal(found.gain_nm_a, pinocchio_arm.transmission.gain_nm_a)
    np.testing.assert_array_equal(found.calibrated, chosen.determined)
    np.testing.assert_array_equal(found.covariance, chosen.covariance[:6, :6])


@pytest.mark.parametrize(
    ("recorded", "when"),
    [
        (("", ""), ""),
        (("2026-03-02T10:00", ""), " of 2026-03-02"),
        (("2026-03-02T10:00", "2026-03-02"), " of 2026-03-02"),
        (("2026-03-02", "2026-03-01"), " from 2026-03-01 to 2026-03-02"),
        (("2026-03", ""), ""),
    ],
)
def test_its_origin_is_in_a_few_words(chosen, recorded, when):
    runs = tuple(structs.replace(chosen.runs[0], recorded=day) for day in recorded)
    weighed = replace(chosen, runs=runs)
    assert weighed.origin == f"2 runs{when}, scale from a weighed payload"
    payloads = tuple(structs.replace(payload, weighed_kg=np.nan) for payload in chosen.payloads)
    nominal = replace(chosen, runs=runs[:1], payloads=payloads)
    assert nominal.origin.startswith("1 run")
    assert nominal.origin.endswith("scale from the nominal gains")
    assert not nominal.scale_weighed


def test_a_tilted_base_turns_gravity_and_keeps_its_size(chosen, pinocchio_arm):
    tilted = replace(chosen, tilt_rad=np.array([0.02, 0.0])).level(pinocchio_arm.chain).gravity_m_s2
    plain = pinocchio_arm.chain.gravity_m_s2
    assert np.linalg.norm(tilted) == pytest.approx(np.linalg.norm(plain))
    angle = np.arccos(tilted @ plain / (plain @ plain))
    assert angle == pytest.approx(np.arctan(0.02), rel=1e-4)
