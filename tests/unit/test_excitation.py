"""Excitation design: strictly feasible, repeatable, and as good as METHOD.md found possible."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.chain import Chain, pose_from_xyz_rpy
from armload_identification.errors import ExcitationError
from armload_identification.excitation import DesignResult, ExcitationLimits, design, margins
from armload_identification.fourier import FourierTrajectory, format_excitation, parse_excitation
from armload_identification.payload import InertialParameters
from armload_identification.regressor import payload_regressor

pytestmark = pytest.mark.pure

# The paper's experiment (METHOD.md): ER-50, joints 1 to 3, the payload in frame 3, tensor signs.
ARM = Chain.from_modified_dh(
    [[np.pi, 0.0, 0.0, 0.0], [np.pi / 2, 0.16, 0.0, -np.pi / 2], [0.0, 0.68, 0.0, 0.0]],
    np.eye(4),
    [0.0, 0.0, -9.81],
)
LIMITS = ExcitationLimits(
    np.array([-2.9, -1.0, -1.2]), np.array([2.9, 1.6, 2.5]), np.array([2.0, 2.0, 2.4]), np.array([6.0, 6.0, 8.0])
)
NOISE_NM = np.array([16.851, 14.230, 13.247])
MASS_KG, CENTER_M = 9.814, np.array([0.130, 0.940, -0.102])
PAYLOAD = InertialParameters(np.r_[MASS_KG, MASS_KG * CENTER_M, 9.023, 0.353, 9.014, -1.222, 0.133, 0.967])


def designed(criterion: str, seed: int = 1, restarts: int = 1, limits: ExcitationLimits = LIMITS) -> DesignResult:
    return design(
        ARM,
        limits,
        harmonics=5,
        base_frequency_hz=0.05,
        torque_noise_nm=NOISE_NM,
        expected_payload=PAYLOAD,
        seed=seed,
        restarts=restarts,
        criterion=criterion,
    )


@pytest.fixture(scope="module")
def results() -> dict[str, DesignResult]:
    return {criterion: designed(criterion, restarts=2) for criterion in ("a-optimal", "condition-number")}


@pytest.fixture(params=["a-optimal", "condition-number"])
def result(request: pytest.FixtureRequest, results: dict[str, DesignResult]) -> DesignResult:
    return results[request.param]


def test_the_motion_is_strictly_within_the_limits_on_a_dense_grid(result):
    state = result.trajectory.evaluate(np.linspace(0.0, 20.0, 50_001))
    assert np.all(state.position_rad > LIMITS.position_min_rad)
    assert np.all(state.position_rad < LIMITS.position_max_rad)
    assert np.all(np.abs(state.velocity_rad_s) < LIMITS.velocity_max_rad_s)
    assert np.all(np.abs(state.acceleration_rad_s2) < LIMITS.acceleration_max_rad_s2)


def test_margins_tell_the_room_that_the_dense_grid_shows(result):
    state = result.trajectory.evaluate(np.linspace(0.0, 20.0, 50_001))
    room = result.margins
    assert room.smallest > 0.0
    below = (state.position_rad - LIMITS.position_min_rad).min(axis=0)
    above = (LIMITS.position_max_rad - state.position_rad).min(axis=0)
    np.testing.assert_allclose(room.position_rad, np.minimum(below, above), atol=1e-4)
    fastest = np.abs(state.velocity_rad_s).max(axis=0)
    np.testing.assert_allclose(room.velocity_rad_s, LIMITS.velocity_max_rad_s - fastest, atol=1e-4)
    hardest = np.abs(state.acceleration_rad_s2).max(axis=0)
    np.testing.assert_allclose(room.acceleration_rad_s2, LIMITS.acceleration_max_rad_s2 - hardest, atol=1e-4)


def test_the_best_start_wins_and_the_history_falls(result):
    assert result.cost == result.restart_costs.min()
    assert result.history[-1] < 0.8 * result.history[0]
    assert result.rank == 10


def relative_deviation(trajectory: FourierTrajectory) -> np.ndarray:
    """Standard deviation over value of every parameter, one period at 100 Hz, by QR."""
    state = trajectory.evaluate(np.arange(2000) * 0.01)
    phi = payload_regressor(ARM, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    inverse = np.linalg.inv(np.linalg.qr((phi / NOISE_NM[:, None]).reshape(-1, 10))[1])
    return np.sqrt(np.sum(inverse**2, axis=1)) / np.abs(PAYLOAD.theta)


def test_a_optimal_halves_what_the_condition_number_leaves_uncertain(results):
    paper, ours = results["condition-number"], results["a-optimal"]
    assert paper.condition_number == pytest.approx(paper.cost)
    assert paper.condition_number < 9.1  # METHOD.md: 7.5 with many starts
    assert ours.condition_number > paper.condition_number
    better = relative_deviation(ours.trajectory) / relative_deviation(paper.trajectory)
    assert np.all(better[[6, 8, 9]] < 0.6)  # Izz, Ixz, Iyz
    assert np.sum(relative_deviation(ours.trajectory) ** 2) == pytest.approx(ours.cost, rel=0.02)


def test_the_same_seed_gives_the_same_motion_and_another_seed_another():
    first, again, other = designed("a-optimal", 4), designed("a-optimal", 4), designed("a-optimal", 5)
    assert np.array_equal(first.trajectory.sin_rad, again.trajectory.sin_rad)
    assert np.array_equal(first.trajectory.offset_rad, again.trajectory.offset_rad)
    assert not np.allclose(first.trajectory.sin_rad, other.trajectory.sin_rad, atol=0.05)


def test_progress_is_told_after_every_start():
    told = []
    design(
        ARM.head(1),
        ExcitationLimits(*(np.array([v]) for v in (-1.0, 1.0, 2.0, 3.0))),
        harmonics=2,
        base_frequency_hz=0.2,
        torque_noise_nm=NOISE_NM[:1],
        expected_payload=PAYLOAD,
        seed=0,
        restarts=3,
        progress=lambda *report: told.append(report),
    )
    assert [(done, count) for done, count, _ in told] == [(1, 3), (2, 3), (3, 3)]
    assert told[2][2] <= told[0][2]


def test_an_arm_that_cannot_show_all_ten_still_gets_a_motion():
    result = design(
        ARM.head(2),
        ExcitationLimits(*(v[:2] for v in (LIMITS.position_min_rad, LIMITS.position_max_rad)), [2.0, 2.0], [6.0, 6.0]),
        harmonics=3,
        base_frequency_hz=0.1,
        torque_noise_nm=NOISE_NM[:2],
        expected_payload=PAYLOAD,
        seed=0,
        restarts=1,
    )
    assert result.rank < 10
    assert result.margins.smallest > 0.0
    assert np.isfinite(result.cost)


def test_tight_limits_far_from_zero_are_kept():
    tight = ExcitationLimits(
        np.array([1.0, -0.9, 1.9]), np.array([1.4, -0.6, 2.4]), np.array([2.0, 2.0, 2.4]), np.array([6.0, 6.0, 8.0])
    )
    assert designed("a-optimal", limits=tight).margins.smallest > 0.0


def test_the_result_becomes_a_file_and_back(result):
    excitation = result.excitation(3, "armload design er50 --seed 1", "0.1.0")
    got = parse_excitation(format_excitation(excitation))
    assert got.design == excitation.design
    assert got.design["cost"] == result.cost
    assert got.design["restarts"] == 2
    assert margins(got.trajectory, LIMITS).smallest == pytest.approx(result.margins.smallest, abs=1e-12)


def test_reduced_limits_leave_the_room_asked_for():
    reduced = LIMITS.reduced(0.1, 0.7)
    np.testing.assert_allclose(reduced.position_min_rad, [-2.8, -0.9, -1.1])
    np.testing.assert_allclose(reduced.position_max_rad, [2.8, 1.5, 2.4])
    np.testing.assert_allclose(reduced.velocity_max_rad_s, [1.4, 1.4, 1.68])
    np.testing.assert_allclose(reduced.acceleration_max_rad_s2, [4.2, 4.2, 5.6])
    with pytest.raises(ExcitationError, match="share 0"):
        LIMITS.reduced(0.1, 0.0)
    with pytest.raises(ExcitationError, match=r"joint 2: positions from .* min < max"):
        LIMITS.reduced(1.5, 1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([1.0], [-1.0], [1.0], [1.0]), "joint 1: positions from 1.0 to -1.0 rad"),
        (([-1.0], [1.0], [0.0], [1.0]), "joint 1: speed 0.0 rad/s"),
        (([-1.0], [1.0], [1.0], [-1.0]), "acceleration -1.0 rad/s2"),
        (([-1.0], [1.0, 2.0], [1.0], [1.0]), "position_max_rad"),
        (([-np.inf], [1.0], [1.0], [1.0]), "position_min_rad is .*finite"),
    ],
)
def test_limits_that_make_no_sense_are_refused(arguments, words):
    with pytest.raises(ExcitationError, match=words):
        ExcitationLimits(*(np.array(a) for a in arguments))


def test_a_design_that_makes_no_sense_is_refused():
    good = {
        "harmonics": 1,
        "base_frequency_hz": 0.1,
        "torque_noise_nm": NOISE_NM,
        "expected_payload": PAYLOAD,
        "seed": 0,
        "restarts": 1,
    }
    elbow = Chain.from_origins(
        [[0, 0, 0]], [[0, 0, 0]], [[0, 0, 1]], pose_from_xyz_rpy([0, 0, 1], [0, 0, 0]), [0, 0, -9]
    )
    with pytest.raises(ExcitationError, match="limits of 3 joints for a chain of 1"):
        design(elbow, LIMITS, **good)
    with pytest.raises(ExcitationError, match="restarts 0"):
        design(ARM, LIMITS, **{**good, "restarts": 0})
    with pytest.raises(ExcitationError, match="criterion is 'best'; expected one of a-optimal, condition-number"):
        design(ARM, LIMITS, **good, criterion="best")
