"""A payload that changes during a run, or a push: found with its time and size, and not found where there is none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation import payload_change
from armload_identification.estimation.payload_change import (
    CHANGING,
    change_in,
    events_between_periods,
)
from armload_identification.estimation.payload_problem import pair_problem, single_problem
from armload_identification.estimation.solve import solve
from armload_identification.model.payload import InertialParameters
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.decision_levels import PayloadChangeLevels

pytestmark = pytest.mark.pure

EDGE_S = PayloadChangeLevels.edge_s
CENTER_M = np.array([0.05, -0.03, 0.1])
ADDED_KG = 1.5


@pytest.fixture(scope="module")
def heavier(pinocchio_arm):
    """The same arm with a payload that has more mass at a place of its own."""
    arm = type(pinocchio_arm)()
    more = InertialParameters.from_center_of_mass(ADDED_KG, list(CENTER_M), 1e-4 * np.eye(3))
    arm.payload = InertialParameters(pinocchio_arm.payload.theta + more.theta)
    return arm


def joined(before, after, at_s):
    """The first run until a time, then the second one."""
    late = before.time_s - before.time_s[0] >= at_s
    return replace(before, current_a=np.where(late[:, None], after.current_a, before.current_a))


def pushed(run, arm, force_n):
    """The run with a force on the flange from 4 to 6 s: the motors give -J^T f more."""
    elapsed_s = run.time_s - run.time_s[0]
    current_a = np.array(run.current_a)
    for row in np.flatnonzero((elapsed_s >= 4.0) & (elapsed_s < 6.0)):
        *joints, flange = arm.chain.forward(run.position_rad[row])
        for joint, pose in enumerate(joints):
            turned = np.cross(pose[:3, :3] @ arm.chain.axis[joint], flange[:3, 3] - pose[:3, 3])
            current_a[row, joint] -= turned @ force_n / arm.transmission.gain_nm_a[joint]
    return replace(run, current_a=current_a)


@pytest.fixture(scope="module")
def single(pinocchio_arm, heavier, calibration):
    """Solves one run of a calibrated arm, in which the payload changes at a time."""
    chain, arm = calibration.level(pinocchio_arm.chain), calibration.known_arm
    transmission = calibration.transmission(pinocchio_arm.transmission)
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    before, after = (each.run(trajectory, True, seed=8, with_phase=False) for each in (pinocchio_arm, heavier))

    def single(at_s=None):
        run = before if at_s is None else joined(before, after, at_s)
        problem = single_problem(Run.of(run, transmission).over_time, chain, transmission.coupling, arm)
        return solve(problem.problem)

    return single


def test_without_a_change_chance_shows_none(single):
    found = change_in(single(), EDGE_S)
    assert found.statistic < PayloadChangeLevels.statistic


@pytest.mark.parametrize("at_s", [9.0, 17.0])
def test_a_change_is_found_with_its_time_and_size(single, at_s):
    found = change_in(single(at_s), EDGE_S)
    assert found.statistic > 1.5 * PayloadChangeLevels.statistic
    assert found.at_s == pytest.approx(at_s, abs=0.6)
    truth = ADDED_KG * np.array([1.0, *CENTER_M])
    assert found.change.shape == found.deviation.shape == (CHANGING,)
    assert found.change[0] == pytest.approx(ADDED_KG, rel=0.1)
    assert (np.abs(found.change - truth) < 4.0 * found.deviation).all()
    assert (found.deviation > 0.0).all()
    assert (found.deviation < [0.3, 0.05, 0.05, 0.12]).all()
    # No part of it is more significant than all together.
    alone = (found.change / found.deviation) ** 2
    assert 0.01 * found.statistic < alone.max() <= found.statistic * (1.0 + 1e-9)


def test_a_short_run_shows_nothing(single):
    posterior = single()
    length_s = np.ptp(posterior.problem.groups[0].time_s)
    assert change_in(posterior, 0.51 * length_s) is None
    assert change_in(posterior, 0.49 * length_s) is not None


@pytest.fixture(scope="module")
def periodic(pinocchio_arm, heavier, pair):
    """The periods of a loaded run, in which the payload changes at a time, and the pair's problem."""
    transmission = pinocchio_arm.transmission
    trajectory = pinocchio_arm.trajectory()
    before, after = (each.run(trajectory, True, seed=11) for each in (pinocchio_arm, heavier))
    arm = pair_problem(
        load_signal(*(Run.of(run, transmission) for run in pair)), pinocchio_arm.chain, transmission.coupling, None
    )

    def periodic(at_s=None, push_n=None):
        run = before if at_s is None else joined(before, after, at_s)
        if push_n is not None:
            run = pushed(run, pinocchio_arm, push_n)
        return events_between_periods(Run.of(run, transmission), arm, 1.0)

    return periodic, float(np.ptp(before.time_s))


def test_periods_that_are_alike_show_none(periodic):
    found, _ = periodic
    change, push = found()
    assert change.statistic < PayloadChangeLevels.statistic
    assert push.statistic < PayloadChangeLevels.push
    assert change.at_s >= 1.0


@pytest.mark.parametrize("push_n", [(0.0, 0.0, -150.0), (150.0, 0.0, 0.0), (0.0, -150.0, 0.0)])
def test_a_push_between_periods_is_found_with_its_time_and_force(periodic, push_n):
    found, _ = periodic
    change, push = found(push_n=push_n)
    assert push.statistic > max(PayloadChangeLevels.push, change.statistic)
    assert push.at_s == pytest.approx(4.0, abs=0.7)
    assert push.change.shape == (3,)
    assert push.change == pytest.approx(push_n, abs=50.0)


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_a_change_between_periods_needs_no_knowledge_of_the_arm(periodic, share):
    found, length_s = periodic
    at_s = share * length_s
    change, _ = found(at_s)
    assert change.statistic > 3.0 * PayloadChangeLevels.statistic
    shift_s = at_s - change.at_s
    assert abs(shift_s) < 0.1 * length_s
    assert change.change[0] == pytest.approx(ADDED_KG, rel=0.2)


@pytest.mark.parametrize(
    ("periods", "average", "interruptions", "by"),
    [
        (1, None, 0, "rows"),
        (1, None, 1, "rows"),
        (3, None, 0, "periods"),
        (0, None, 0, "periods"),
        (3, object(), 0, None),
        (3, None, 1, None),
    ],
)
def test_a_change_is_looked_for_where_the_run_was_kept_whole(monkeypatch, periods, average, interruptions, by):
    """In the rows of a run that is not averaged, between the periods of one that is; not of one averaged on reading."""
    monkeypatch.setattr(payload_change, "change_in", lambda found, edge_s: ("rows", found, edge_s))
    both = "events_between_periods"
    monkeypatch.setattr(payload_change, both, lambda run, arm, edge_s: (("periods", arm, edge_s), "push"))
    run = SimpleNamespace(recording=SimpleNamespace(average=average))
    motion = SimpleNamespace(periods=periods, interruptions=interruptions)
    change, push = payload_change.events_during(run, motion, "posterior", "arm", 6.0)
    assert change == (by and (by, {"rows": "posterior", "periods": "arm"}[by], 6.0))
    assert push == ("push" if by == "periods" else None)
