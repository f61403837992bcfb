"""Excitation design: strictly feasible, reproducible, and as good as is known to be possible."""

from __future__ import annotations

from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.excitation.design import DesignResult, optimal_excitation
from armload_identification.excitation.design_envelope import Envelope, ExcitationLimits
from armload_identification.excitation.design_search import PeriodRange, SearchSettings, SlowRound
from armload_identification.excitation.excitation_file import format_excitation, parse_excitation
from armload_identification.excitation.fourier import FourierBounds, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.geometry.workspace import Box, HalfSpace, Sphere, Workspace
from armload_identification.excitation.information import Criterion, named_criterion
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.identification_errors import ExcitationError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor
from tests.smallest_margin import smallest_margin

pytestmark = pytest.mark.pure

# The experiment of Chen 2016: ER-50, joints 1 to 3, the payload in frame 3, tensor signs.
ARM = Chain.from_modified_dh(
    [[np.pi, 0.0, 0.0, 0.0], [np.pi / 2, 0.16, 0.0, -np.pi / 2], [0.0, 0.68, 0.0, 0.0]],
    np.eye(4),
    [0.0, 0.0, -9.81],
)
LIMITS = ExcitationLimits(
    np.array([-2.9, -1.0, -1.2]),
    np.array([2.9, 1.6, 2.5]),
    np.array([2.0, 2.0, 2.4]),
    np.array([6.0, 6.0, 8.0]),
    np.array([600.0, 600.0, 800.0]),
)
TORQUE_NM = np.array([3240.0, 4788.0, 2376.0])
NOISE_NM = np.array([16.851, 14.230, 13.247])
MASS_KG, CENTER_M = 9.814, np.array([0.130, 0.940, -0.102])
PAYLOAD = InertialParameters(np.r_[MASS_KG, MASS_KG * CENTER_M, 9.023, 0.353, 9.014, -1.222, 0.133, 0.967])


def only(period_s: float) -> PeriodRange:
    return PeriodRange(period_s, period_s, period_s)


TEN_SECONDS = only(10.0)


def wide(chain: Chain = ARM, limits: ExcitationLimits = LIMITS) -> Envelope:
    """Only the joints' limits: strong joints, no obstacles."""
    strong = TorqueLimits.from_share(chain, np.zeros(chain.n), PAYLOAD, 10.0 * TORQUE_NM[: chain.n])
    return Envelope(limits, strong, Workspace(chain))


def criterion_of(name: str, chain: Chain = ARM) -> Criterion:
    return named_criterion(name, chain, NOISE_NM[: chain.n], PAYLOAD)


def designed(name: str, seed: int = 1, limits=LIMITS, harmonics: int = 5) -> DesignResult:
    envelope = wide(limits=limits)
    return optimal_excitation(criterion_of(name), envelope, SearchSettings(harmonics, only(20.0), seed, 1))


@pytest.fixture(scope="module")
def results() -> dict[str, DesignResult]:
    return {criterion: designed(criterion) for criterion in ("a-optimal", "condition-number")}


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
    assert smallest_margin(room) > 0.0
    below = (state.position_rad - LIMITS.position_min_rad).min(axis=0)
    above = (LIMITS.position_max_rad - state.position_rad).min(axis=0)
    np.testing.assert_allclose(room.position_rad, np.minimum(below, above), atol=1e-4)
    fastest = np.abs(state.velocity_rad_s).max(axis=0)
    np.testing.assert_allclose(room.velocity_rad_s, LIMITS.velocity_max_rad_s - fastest, atol=1e-4)
    hardest = np.abs(state.acceleration_rad_s2).max(axis=0)
    np.testing.assert_allclose(room.acceleration_rad_s2, LIMITS.acceleration_max_rad_s2 - hardest, atol=1e-4)


def test_the_history_falls(result):
    assert result.history[-1] < 0.8 * result.history[0]
    assert result.rank == 10


def relative_deviation(trajectory: FourierTrajectory) -> np.ndarray:
    """Standard deviation over value of every parameter beside changes of friction, one period at 100 Hz, by QR."""
    state = trajectory.evaluate(np.arange(2000) * 0.01)
    phi = payload_regressor(ARM, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    unknown = np.zeros((*state.position_rad.shape, ARM.n, 3))
    for joint, speed in enumerate(state.velocity_rad_s.T):
        unknown[:, joint, joint] = np.column_stack([speed / np.hypot(speed, 0.05), speed, np.ones(speed.size)])
    rows = np.concatenate([phi, unknown.reshape(*state.position_rad.shape, -1)], axis=2) / NOISE_NM[:, None]
    inverse = np.linalg.inv(np.linalg.qr(rows.reshape(-1, rows.shape[2]))[1])
    return np.sqrt(np.sum(inverse[:10] ** 2, axis=1)) / np.abs(PAYLOAD.theta)


def test_a_optimal_halves_what_the_condition_number_leaves_uncertain(results):
    paper, ours = results["condition-number"], results["a-optimal"]
    assert paper.condition_number == pytest.approx(paper.cost)
    assert paper.condition_number < 9.1  # 7.5 with many starts
    assert ours.condition_number > paper.condition_number
    better = relative_deviation(ours.trajectory) / relative_deviation(paper.trajectory)
    assert np.all(better[[6, 8, 9]] < 0.6)  # Izz, Ixz, Iyz
    assert np.sum(relative_deviation(ours.trajectory) ** 2) == pytest.approx(ours.cost, rel=0.02)


def test_with_a_slow_round_the_information_per_time_of_the_whole_run_counts(results):
    limit, slow_rate, measured_s = SpeedLimit(ArmPoints(ARM, CENTER_M), 0.25), 0.25, 30.0
    settings = SearchSettings(5, only(20.0), 1, 1, SlowRound(limit, slow_rate, measured_s))
    alone, shorter = results["a-optimal"], optimal_excitation(criterion_of("a-optimal"), wide(), settings)

    def run_s(path):
        state = path.evaluate(np.linspace(0.0, path.period_s, 1000, endpoint=False))
        speed_m_s = limit.points.speeds(state.position_rad, state.velocity_rad_s).max(axis=1)
        return measured_s + path.period_s * np.mean(np.maximum(speed_m_s / limit.speed_m_s, 1.0 / slow_rate))

    assert run_s(shorter.trajectory) < 0.85 * run_s(alone.trajectory)
    assert shorter.cost * run_s(shorter.trajectory) < alone.cost * run_s(alone.trajectory)
    middle = 0.5 * (wide().joints.position_min_rad + wide().joints.position_max_rad)
    at = shorter.trajectory.period(120).position_rad
    way = limit.points.speeds(at, at - middle).max(axis=1)
    assert way[0] == pytest.approx(way.min(), rel=1e-6)  # where it begins
    assert np.all(np.abs(shorter.trajectory.offset_rad - middle) <= np.pi)


def test_the_same_seed_gives_the_same_motion_and_another_seed_another():
    first, again, other = (designed("a-optimal", seed, harmonics=1) for seed in (4, 4, 5))
    assert np.array_equal(first.trajectory.sin_rad, again.trajectory.sin_rad)
    assert np.array_equal(first.trajectory.offset_rad, again.trajectory.offset_rad)
    assert not np.allclose(first.trajectory.sin_rad, other.trajectory.sin_rad, atol=0.05)


def test_progress_is_reported_after_every_start():
    reported = []
    one = ExcitationLimits(*(np.array([v]) for v in (-1.0, 1.0, 2.0, 3.0, 30.0)))
    optimal_excitation(
        criterion_of("a-optimal", ARM.head(1)),
        wide(ARM.head(1), one),
        SearchSettings(harmonics=2, periods=only(5.0), seed=0, restarts=3),
        progress=reported.append,
    )
    assert reported == [1, 2, 3]


def test_an_arm_that_cannot_show_all_ten_still_gets_a_motion():
    head = ARM.head(2)
    limits = ExcitationLimits(*(getattr(LIMITS, name)[:2] for name in FourierBounds.__slots__))
    result = optimal_excitation(
        criterion_of("a-optimal", head),
        wide(head, limits),
        SearchSettings(harmonics=3, periods=only(10.0), seed=0, restarts=1),
    )
    assert result.rank < 10
    assert smallest_margin(result.margins) > 0.0
    assert np.isfinite(result.cost)


def test_tight_limits_far_from_zero_are_kept():
    tight = ExcitationLimits(
        np.array([1.0, -0.9, 1.9]),
        np.array([1.4, -0.6, 2.4]),
        LIMITS.velocity_max_rad_s,
        LIMITS.acceleration_max_rad_s2,
        LIMITS.jerk_max_rad_s3,
    )
    assert smallest_margin(designed("a-optimal", limits=tight).margins) > 0.0


class Crowded:
    """The paper's arm with links, joints barely strong enough, a floor, a table and its own shoulder."""

    links = tuple(
        InertialParameters.from_center_of_mass(m, c, np.diag(i))
        for m, c, i in (
            (70.0, [0.06, 0.02, -0.10], [2.2, 2.4, 2.0]),
            (55.0, [0.30, 0.01, 0.05], [0.6, 3.4, 3.3]),
            (60.0, [0.09, 0.12, 0.02], [2.4, 1.2, 2.2]),
        )
    )
    body = ArmBody(
        np.array([link.theta for link in links]),
        np.array([36.0, 58.8, 18.2]),
        np.array([60.0, 70.0, 40.0]),
        np.array([45.0, 55.0, 35.0]),
        np.eye(3),
    )
    torque_nm = np.array([900.0, 1250.0, 450.0])
    joints = ExcitationLimits(
        *(getattr(LIMITS, name) for name in FourierBounds.__slots__[:4]), np.array([40.0, 40.0, 40.0])
    )
    spheres = (
        Sphere(1, np.array([0.08, 0.0, 0.0]), 0.3),
        Sphere(2, np.array([0.34, 0.0, 0.0]), 0.2),
        Sphere(2, np.array([0.68, 0.0, 0.0]), 0.2),
        Sphere(3, np.array([0.13, 0.4, 0.0]), 0.15),
        Sphere(4, CENTER_M, 0.2),
    )
    floor = HalfSpace("floor", np.array([0.0, 0.0, 1.0]), -0.4, (1, 2, 3, 4))
    table = Box("table", pose_from_xyz_rpy([0.9, 0.5, -0.2], [0.0, 0.0, 0.5]), np.array([0.4, 0.6, 0.6]), (2, 3, 4))
    workspace = Workspace(ARM, spheres, (floor,), (table,), ((1, 4),))
    envelope = Envelope(joints, TorqueLimits(ARM, body, PAYLOAD, torque_nm - body.coulomb_nm), workspace)

    def designed(
        self, executor: Executor | None = None, periods=TEN_SECONDS, harmonics=2, seed=3, restarts=1
    ) -> DesignResult:
        return optimal_excitation(
            criterion_of("a-optimal"),
            self.envelope,
            SearchSettings(harmonics, periods, seed, restarts),
            executor=executor,
        )


@pytest.fixture(scope="module")
def crowded() -> DesignResult:
    return Crowded().designed()


def test_every_limit_holds_on_a_dense_grid_that_pinocchio_evaluates(crowded, in_pinocchio):
    arm = Crowded()
    state = crowded.trajectory.evaluate(np.linspace(0.0, crowded.trajectory.period_s, 6_000))
    q, dq, ddq = state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
    assert np.all((q > arm.joints.position_min_rad) & (q < arm.joints.position_max_rad))
    assert np.all(np.abs(dq) < arm.joints.velocity_max_rad_s)
    assert np.all(np.abs(ddq) < arm.joints.acceleration_max_rad_s2)
    assert np.all(np.abs(state.jerk_rad_s3) < arm.joints.jerk_max_rad_s3)
    for payload in (None, PAYLOAD):
        model = in_pinocchio(ARM, arm.links, payload)
        data = model.createData()
        for rate in (0.0, 0.5, 1.0):
            rows = zip(q, rate * dq, rate**2 * ddq, strict=True)
            torque = np.array([pin.rnea(model, data, *row) for row in rows])
            torque += arm.body.rotor_inertia_kg_m2 * rate**2 * ddq + arm.body.viscous_nm_s_rad * rate * dq
            assert np.all(np.abs(torque + np.sign(dq) * arm.body.coulomb_nm) < arm.torque_nm)
    poses = np.array([ARM.forward(row) for row in q[::3]])
    centre = [poses[:, s.link - 1, :3, :3] @ s.center_m + poses[:, s.link - 1, :3, 3] for s in arm.spheres]
    pose, half = arm.table.pose, 0.5 * arm.table.size_m
    for at, sphere in zip(centre, arm.spheres, strict=True):
        assert np.all(at[:, 2] - sphere.radius_m > arm.floor.offset_m)
        if sphere.link != 1:
            local = (at - pose[:3, 3]) @ pose[:3, :3]
            assert np.all(np.linalg.norm(local - np.clip(local, -half, half), axis=1) > sphere.radius_m)
    assert np.all(np.linalg.norm(centre[0] - centre[4], axis=1) > 0.5)
    assert smallest_margin(crowded.margins) > 0.0


def test_the_limits_are_used_to_the_full(crowded):
    """Of torque, speed and workspace, at least two limits are active somewhere."""
    room = crowded.margins
    binding = (
        room.torque_nm.min() < 0.01 * Crowded.torque_nm.max(),
        min(room.velocity_rad_s.min(), room.acceleration_rad_s2.min()) < 0.01,
        min(room.clearance_m.values()) < 0.02,
    )
    assert sum(binding) >= 2, room


@pytest.fixture(scope="module")
def one_after_the_other() -> DesignResult:
    return Crowded().designed(harmonics=1, seed=7, restarts=2)


def test_the_best_start_wins(one_after_the_other):
    """Here the second one."""
    costs = one_after_the_other.restart_costs
    assert one_after_the_other.cost == costs[1] < costs[0]


def test_the_result_becomes_a_file_and_back(one_after_the_other):
    result = one_after_the_other
    excitation = result.excitation(3, "armload design er50 --seed 1", "0.1.0")
    got = parse_excitation(format_excitation(excitation))
    assert got.design == excitation.design
    assert got.design["cost"] == result.cost
    assert got.design["restarts"] == 2
    assert smallest_margin(Crowded.envelope.margins(got.trajectory)) == pytest.approx(
        smallest_margin(result.margins), abs=1e-12
    )


@pytest.mark.parametrize("kind", ["threads", "processes"])
@pytest.mark.long
def test_whoever_runs_the_starts_the_result_is_the_same(one_after_the_other, kind):
    pools = {
        "threads": lambda: ThreadPoolExecutor(2),
        "processes": lambda: ProcessPoolExecutor(2, mp_context=get_context("spawn")),
    }
    with pools[kind]() as executor:
        again = Crowded().designed(executor, harmonics=1, seed=7, restarts=2)
    assert np.array_equal(again.trajectory.sin_rad, one_after_the_other.trajectory.sin_rad)
    assert np.array_equal(again.trajectory.offset_rad, one_after_the_other.trajectory.offset_rad)
    assert np.array_equal(again.restart_costs, one_after_the_other.restart_costs)
    assert np.array_equal(again.history, one_after_the_other.history)


def test_a_chosen_period_is_as_fast_as_the_path_allows(crowded):
    chosen = Crowded().designed(periods=PeriodRange(2.0, 40.0, 0.1))
    path = chosen.trajectory
    assert path.period_s / 0.1 == pytest.approx(round(path.period_s / 0.1))
    assert 2.0 < path.period_s < 40.0
    assert smallest_margin(chosen.margins) > 0.0
    faster = FourierTrajectory(1.03 * path.base_frequency_hz, path.offset_rad, path.sin_rad, path.cos_rad)
    assert smallest_margin(Crowded.envelope.margins(faster)) < 0.0
    # for the same measuring time it is about as informative as a fixed period of ten seconds, or more
    assert chosen.cost * path.period_s < 1.05 * crowded.cost * crowded.trajectory.period_s


def test_an_arm_that_cannot_even_stand_is_reported():
    weak = TorqueLimits(ARM, Crowded.body, PAYLOAD, np.array([60.0, 60.0, 40.0]) - Crowded.body.coulomb_nm)
    with pytest.raises(
        ExcitationError, match=r"none of 1 starts .* within all limits; .* requires \d+\.\d % more torque than joint 3 "
    ):
        optimal_excitation(
            criterion_of("a-optimal"),
            Envelope(LIMITS, weak, Workspace(ARM)),
            SearchSettings(harmonics=2, periods=only(10.0), seed=0, restarts=1),
        )


def test_a_design_that_makes_no_sense_is_refused():
    good = {"harmonics": 1, "periods": only(10.0), "seed": 0, "restarts": 1}
    chosen = criterion_of("a-optimal")
    with pytest.raises(ExcitationError, match="limits of 3 joints for a chain of 2"):
        optimal_excitation(criterion_of("a-optimal", ARM.head(2)), wide(), SearchSettings(**good))
    with pytest.raises(ExcitationError, match="restarts 0"):
        optimal_excitation(chosen, wide(), SearchSettings(**{**good, "restarts": 0}))
    with pytest.raises(ExcitationError, match=r"periods from 5.0 to 2.0 s"):
        PeriodRange(5.0, 2.0, 0.1)
    with pytest.raises(ExcitationError, match=r"steps of 0.0 s"):
        PeriodRange(2.0, 5.0, 0.0)
