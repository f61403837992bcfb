"""Errors of a payload by elastic gears: on a pair whose shoulder and elbow give way, and on a rigid one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.estimation.arm_terms import PAYLOAD
from armload_identification.estimation.elastic_joints import elastic_torque
from armload_identification.estimation.payload_problem import pair_problem
from armload_identification.estimation.solve import solve
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run

COMPLIANCE = np.array([0.0, 4e-5, 6e-5, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def known(calibration, pinocchio_arm):
    return calibration.level(pinocchio_arm.chain), calibration.known_arm


@pytest.fixture(scope="module")
def problems(calibration, pinocchio_arm, pair, known):
    """Of a rigid and of an elastic arm."""
    transmission = calibration.transmission(pinocchio_arm.transmission)
    loads = pinocchio_arm.payload, None
    elastic = [sagging(run, pinocchio_arm, load) for run, load in zip(pair, loads, strict=True)]
    signals = [load_signal(*(Run.of(run, transmission) for run in runs)) for runs in (pair, elastic)]
    chain, arm = known
    return [pair_problem(signal, chain, transmission.coupling, arm) for signal in signals]


@pytest.fixture(scope="module")
def payloads(problems, known):
    """Of a rigid and of an elastic arm: the payload, and its errors."""
    chain, arm = known
    found = []
    for problem in (each.problem for each in problems):
        posterior = solve(problem)
        (torque_nm,) = elastic_torque(posterior, chain, arm.body)
        errors = posterior.response(torque_nm)[problem.place(PAYLOAD, PAYLOAD)]
        found.append((posterior.value(PAYLOAD, PAYLOAD), np.sqrt(np.sum(errors**2, axis=1))))
    return found


def sagging(run, arm, payload):
    """The run as encoders of the motors see it, if gears give way under the links and the payload."""
    states = run.excitation.trajectory.evaluate(run.phase_s)
    model = arm._model(payload)
    data = model.createData()
    motion = zip(states.position_rad, states.velocity_rad_s, states.acceleration_rad_s2, strict=True)
    carried = np.array([pin.rnea(model, data, *state) for state in motion])
    return replace(run, position_rad=run.position_rad + COMPLIANCE * carried)


def test_a_payload_of_gears_that_give_way_is_off_as_all_of_a_lag_of_which_a_third_is_allowed_for(payloads):
    (rigid, _), (elastic, deviation) = payloads
    off = (elastic - rigid) / deviation
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(3.0), rel=0.2)
    assert np.abs(off).max() < 3.0


def test_rows_that_show_no_lag_leave_less_than_those_that_do(payloads):
    (_, less), (_, more) = payloads
    assert np.all(less[:4] < more[:4])
    assert np.all(less > 0.0)


def test_a_single_row_says_nothing_of_rates(problems, known):
    """As of a slow round that is almost too short."""
    chain, arm = known
    time_s = problems[0].problem.groups[0].time_s
    posterior = solve(problems[0].between(time_s[50], time_s[51]).problem, rough=True)
    (torque_nm,) = elastic_torque(posterior, chain, arm.body)
    assert torque_nm.shape == (chain.n, 1, chain.n)
    assert np.isfinite(torque_nm).all()
