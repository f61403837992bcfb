"""Rows of a fast motion: what an arm's own parameters make of them, and Pinocchio's torque, through one window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.arm_rows import ArmLayout, close_rows, motion_with_rows, peak_rad_s, row_window
from armload_identification.model.payload import InertialParameters
from armload_identification.signals.recorded_run import Run
from tests.unit.conftest import LINK_KG

pytestmark = pytest.mark.pure

COULOMB_NM, VISCOUS_NM_S_RAD = 4.0, 5.0
COUNTS = 0.3
"""Weight of a row away from reversals."""


@pytest.fixture(scope="module")
def fast(pinocchio_arm):
    """Three periods of 3 s without noise; joints reach 2 to 5 rad/s."""
    return pinocchio_arm.run(pinocchio_arm.trajectory(5, period_s=3.0, harmonics=3), True, seed=1, noise=0.0)


@pytest.fixture(scope="module")
def links():
    """(60,) all parameters of Pinocchio's links."""
    bodies = [InertialParameters.from_center_of_mass(kg, [0.01, 0.02, 0.15], 0.02 * kg * np.eye(3)) for kg in LINK_KG]
    return np.concatenate([body.theta for body in bodies])


def motion_of(run, arm):
    return motion_with_rows(Run.of(run, arm.transmission))


def without_phase(run):
    return replace(run, phase_s=None, excitation=None)


def rows_of(arm, run):
    motion = motion_of(run, arm)
    base = np.ones(60, dtype=bool)
    return ArmLayout(arm.chain, arm.transmission.coupling, base, peak_rad_s(motion)).rows(motion, loaded=True)


def left_of(arm, rows, links, delay_s=0.0):
    """(n,) RMS of what the arm's own parameters leave, as a share of each axis' effort."""
    torque = rows.links @ links + rows.payload @ arm.payload.theta
    torque += delay_s * (rows.links_moved[:, 0] @ links + rows.payload_moved[:, 0] @ arm.payload.theta)
    torque += COULOMB_NM * rows.direction + VISCOUS_NM_S_RAD * rows.velocity_rad_s
    left = np.where(rows.weight > COUNTS, rows.effort_nm - torque @ arm.transmission.coupling, 0.0)
    return np.sqrt(np.mean(left**2, axis=0) / np.mean(rows.effort_nm**2, axis=0))


@pytest.mark.parametrize("periodic", [True, False])
def test_the_mean_torque_of_a_fast_motion_is_explained(pinocchio_arm, fast, links, periodic):
    """The torque at the window's middle, in place of the mean torque, leaves 3 to 10 % of it."""
    run = fast if periodic else without_phase(fast)
    rows = rows_of(pinocchio_arm, run)
    assert (np.count_nonzero(rows.weight > COUNTS, axis=0) >= 15).all()
    assert (left_of(pinocchio_arm, rows, links) < 5e-4).all()


def test_phases_without_a_sample_are_no_holes(pinocchio_arm, fast):
    """A third of the samples lost: a few phases of the period have none, and the rows about them remain."""
    kept = np.random.default_rng(3).uniform(size=fast.size) < 0.65
    whole, thinned = (motion_of(run, pinocchio_arm) for run in (fast, fast.rows(kept)))
    of_whole = row_window(whole).middle.size
    assert row_window(thinned).middle.size == of_whole
    hole = motion_of(fast.rows(fast.phase_s % 3.0 > 0.3), pinocchio_arm)
    assert 0.75 < row_window(hole).middle.size / of_whole < 0.85
    np.testing.assert_allclose(peak_rad_s(thinned), peak_rad_s(whole), rtol=0.01)


@pytest.mark.parametrize(("period_s", "half_s"), [(2.0, 0.064), (5.0, 0.16), (12.0, 0.16)])
def test_close_rows_of_a_pair_keep_their_window_unless_the_period_is_below_five_seconds(
    pinocchio_arm, period_s, half_s
):
    """A shorter window shows the ringing of elastic joints, of which their encoders show little."""
    run = pinocchio_arm.run(pinocchio_arm.trajectory(5, period_s=period_s, harmonics=3), True, seed=1, noise=0.0)
    window = close_rows(motion_of(run, pinocchio_arm))
    assert len(window.middle) >= 100
    assert window.half_s == pytest.approx(half_s)


def test_the_ends_of_a_run_do_not_make_a_joint_move(pinocchio_arm, fast):
    """Joint 6 is held; at either end the row's window would be filled up with one and the same sample."""
    noise = 2e-5 * np.random.default_rng(3).normal(size=fast.size)
    held = without_phase(replace(fast, position_rad=np.column_stack([fast.position_rad[:, :5], noise])))
    assert peak_rad_s(motion_of(held, pinocchio_arm))[5] < 5e-4


def test_a_delay_of_the_torque_is_seen_through_the_window(pinocchio_arm, fast, links):
    """On the joints whose friction, which is not delayed, is little of their torque."""
    run, delay_s = without_phase(fast), 0.005
    current = np.column_stack([np.interp(run.time_s - delay_s, run.time_s, column) for column in run.current_a.T])
    rows = rows_of(pinocchio_arm, replace(run, current_a=current))
    ignored, known = (left_of(pinocchio_arm, rows, links, by_s)[:3] for by_s in (0.0, delay_s))
    assert (ignored > 0.01).all()
    assert (known < 0.2 * ignored).all()


def test_a_run_with_gaps_throughout_has_no_rows(pinocchio_arm, fast):
    gaps = without_phase(fast.rows(slice(None, None, 12)))
    assert not row_window(motion_of(gaps, pinocchio_arm)).middle.size
    rows = rows_of(pinocchio_arm, gaps)
    assert rows.links.shape == (0, 6, 60)
    assert rows.payload_moved.shape == (0, 3, 6, 10)


def test_noise_of_a_fast_recording_is_averaged_and_not_aliased(pinocchio_arm):
    """At 100 Hz a tone of 99 Hz looks like one of 1 Hz; white noise on a row is a third of that at 100 Hz."""
    trajectory = pinocchio_arm.trajectory(5, period_s=4.0, harmonics=2)
    run = without_phase(pinocchio_arm.run(trajectory, False, seed=1, periods=1, cycle_s=1e-3, noise=0.0))
    clean = motion_of(run, pinocchio_arm)
    tone = np.sin(2.0 * np.pi * 99.0 * run.time_s)[:, None] * np.ones(6)
    white = np.random.default_rng(2).normal(size=tone.shape)
    for noise, most in ((tone, 0.02), (white, 0.1)):
        noisy = replace(run, current_a=run.current_a + noise / pinocchio_arm.transmission.gain_nm_a)
        motion = motion_of(noisy, pinocchio_arm)
        shift = row_window(motion).mean(motion.raw_nm - clean.raw_nm)
        assert (np.sqrt(np.mean(shift**2, axis=0)) < most).all()
