"""What one run shows of a calibrated arm: gains and friction beside an unknown payload."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration.run_health import run_health
from armload_identification.identification_errors import RecordingError
from armload_identification.model.payload import InertialParameters
from tests.mounted_runs import LOAD_FRICTION

pytestmark = pytest.mark.pure


def test_a_run_by_itself_shows_other_gains_and_friction_beside_an_unknown_payload(result, pinocchio_arm, nominal):
    """Joint 2 with 4 % more torque per ampere than calibrated, joint 4 with 50 % more friction."""
    arm = type(pinocchio_arm)()
    arm.payload = InertialParameters.from_center_of_mass(3.3, [0.08, 0.02, 0.10], 0.03 * np.eye(3))
    found = arm.run(arm.trajectory(6, period_s=10.0), True, seed=71, load_friction=LOAD_FRICTION, with_phase=False)
    speed = np.gradient(found.position_rad, found.time_s, axis=0)[:, 3]
    more = 0.5 * result.friction_nm[3]
    current = found.current_a.copy()
    current[:, 1] /= 1.04
    current[:, 3] += more * np.tanh(speed / 0.02) / pinocchio_arm.transmission.gain_nm_a[3]

    def health(run, mounting=None):
        return run_health(run, result, arm.chain, nominal, mounting=mounting)

    before, after = health(found), health(replace(found, current_a=current))
    for one in (before, after):
        assert float(one.carried.split()[0]) == pytest.approx(3.3, abs=0.1)
        spread = np.hypot(one.gain.noise, one.gain.doubt)
        assert (np.abs(one.gain.value - np.array([0.0, 0.04 * (one is after), 0, 0, 0, 0])) < 4.0 * spread).all()
    assert after.gain.value[1] == pytest.approx(0.04, abs=0.01)
    change = after.friction.value - before.friction.value
    assert change[3] == pytest.approx(more, rel=0.15)
    assert (np.abs(np.delete(change, 3)) < 5.0 * np.delete(after.friction.noise, 3)).all()
    assert (before.residual.value < np.log(2.5)).all()
    for one in (before.gain, before.friction, before.residual):
        assert (0.02 * one.noise < one.doubt).all()
        assert (one.doubt < 20.0 * one.noise).all()
    # Stated as empty, its payload remains in the residual.
    assert health(found, mounting="").residual.value.max() > np.log(3.0)
    assert health(found, mounting="").carried == "nothing"
    with pytest.raises(RecordingError, match="it contains joint torque, but the arm was calibrated with motor current"):
        health(replace(found, current_a=None, torque_nm=found.current_a))


def test_a_joint_that_stands_still_in_a_run_has_no_health(result, runs, pinocchio_arm, nominal):
    run = runs[0].recording
    position = run.position_rad.copy()
    position[:, 0] = position[0, 0]
    one = replace(run, position_rad=position)
    still = run_health(one, result, pinocchio_arm.chain, nominal, mounting="")
    assert np.isnan(still.gain.value[0])
    assert np.isnan(still.friction.value[0])
    assert np.isnan(still.residual.value[0])
    assert np.isfinite(still.gain.value[1:]).all()
    frozen = replace(run, position_rad=np.tile(position[0], (len(position), 1)) + 1e-9 * run.position_rad)
    with pytest.raises(RecordingError, match="no joint moves"):
        run_health(frozen, result, pinocchio_arm.chain, nominal)


def test_a_long_run_shows_when_friction_changed(result, pinocchio_arm, nominal):
    """Joint 4 rubs 50 % more during the second third of 200 s; some seconds at both ends are lost to filters."""
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    settings = {"periods": 20, "cycle_s": 0.02, "load_friction": LOAD_FRICTION, "with_phase": False}
    found = pinocchio_arm.run(trajectory, False, seed=72, **settings)
    speed = np.gradient(found.position_rad, found.time_s, axis=0)[:, 3]
    second = np.abs(found.time_s - found.time_s.mean()) < 32.0
    more, current = 0.5 * result.friction_nm[3], found.current_a.copy()
    current[:, 3] += second * more * np.tanh(speed / 0.02) / pinocchio_arm.transmission.gain_nm_a[3]

    def course(run):
        return run_health(run, result, pinocchio_arm.chain, nominal, mounting="").course

    long = course(replace(found, current_a=current))
    assert long.elapsed_s[1] == pytest.approx(100.0, abs=0.5)
    assert np.diff(long.elapsed_s) == pytest.approx(64.0, abs=2.5)
    expected = np.zeros((3, 6))
    expected[1, 3] = more
    assert (np.abs(long.friction_nm - long.friction_nm[2] - expected) < 5.0 * long.noise_nm + 0.1 * expected).all()
    assert (long.noise_nm[:, 3] < 0.1 * more).all()
    of_two = {name: getattr(found, name)[:8500] for name in ("time_s", "position_rad", "current_a")}
    assert course(replace(found, **of_two)) is None
