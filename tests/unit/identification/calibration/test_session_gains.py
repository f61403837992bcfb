"""Gains that drift together after the calibration of Pinocchio's arm: allowed for, or measured by a reference."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from armload_identification.calibration.calibration_result import FEWEST_SESSIONS
from armload_identification.calibration.session_gains import ASSUMED, LEAST, ConfiguredArm, SessionGains
from armload_identification.files.calibration_file import format_calibration, parse_calibration
from armload_identification.pipeline.payload_identification import identify_runs

pytestmark = pytest.mark.pure
DRIFT = 1.03


def drifted(arm, loaded, seed):
    """A run whose motors give less torque per ampere, so that they take more current."""
    run = arm.run(arm.trajectory(6 if loaded else 7, period_s=10.0), loaded, seed=seed, with_phase=False)
    return replace(run, current_a=DRIFT * run.current_a)


def identified(calibration, arm, session):
    level, gains = calibration.level(arm.chain), session.corrected(calibration).transmission(arm.transmission)
    known = session.arm(calibration.known_arm)
    return identify_runs(drifted(arm, True, 81), None, level, gains, arm=known)


def off(found, arm):
    """Error of the mass, and half width of its interval."""
    return abs(found.parameters.mass_kg - arm.payload.mass_kg), found.uncertainty.half_width_95[0]


def test_a_drift_is_outside_the_interval_unless_it_is_allowed_for(calibration, pinocchio_arm):
    error, half_width = off(identified(calibration, pinocchio_arm, SessionGains(0.0, 1e-9, "none")), pinocchio_arm)
    assert error > 2.0 * half_width
    allowed = SessionGains.assumed(calibration, 0.03)
    error, half_width = off(identified(calibration, pinocchio_arm, allowed), pinocchio_arm)
    assert error < half_width


@pytest.mark.parametrize("factor", [1.0, DRIFT])
def test_the_run_itself_says_how_large_it_can_be(calibration, pinocchio_arm, factor):
    """Not more than the run leaves possible; a drift that the run shows is allowed for, and not corrected."""
    arm = pinocchio_arm
    prior = SessionGains.assumed(calibration, 0.03)
    run = drifted(arm, True, 81)
    run = replace(run, current_a=factor / DRIFT * run.current_a)
    session = prior.within(run, ConfiguredArm(calibration, arm.chain, arm.transmission), loaded=True)
    assert session.log_factor == 0.0
    assert (session.deviation < 0.006) == (factor == 1.0)
    level, gains = calibration.level(arm.chain), calibration.transmission(arm.transmission)
    found = identify_runs(run, None, level, gains, arm=session.arm(calibration.known_arm))
    error, half_width = off(found, arm)
    assert error < half_width
    assert bool(re.search(r"which alone indicates -[23]\.", session.note(1.0, 0.0))) == (factor == DRIFT)


@pytest.mark.parametrize("tool", [False, True])
def test_a_reference_of_the_session_measures_it(calibration, pinocchio_arm, tool):
    """Empty, or with a weighed tool, whose centre of mass is unknown."""
    arm = pinocchio_arm
    mass_kg = arm.payload.mass_kg if tool else None
    prior = SessionGains.assumed(calibration, 0.05)
    configured = ConfiguredArm(calibration, arm.chain, arm.transmission)
    session = prior.measured(drifted(arm, tool, 82), configured, mass_kg)
    assert session.log_factor == pytest.approx(-np.log(DRIFT), abs=3.0 * session.deviation)
    assert LEAST <= session.deviation < 0.01
    error, half_width = off(identified(calibration, arm, session), arm)
    assert error < half_width < 0.1 * arm.payload.mass_kg
    assert "is corrected: -2.9" in session.note(1.0, 0.0)
    assert "far more than expected" not in session.origin


def test_a_reference_that_carries_more_than_stated_is_doubted(calibration, pinocchio_arm):
    """What it says of the drift is corrected as before."""
    arm, prior = pinocchio_arm, SessionGains.assumed(calibration)
    session = prior.measured(drifted(arm, True, 82), ConfiguredArm(calibration, arm.chain, arm.transmission), None)
    assert "far more than expected: check that it is of the same day and carried what is stated" in session.origin


def test_the_prior_is_the_scatter_of_three_sessions_else_one_percent(calibration):
    """The runs of one calibration, said to be of several days, with factors that differ by 2 %."""

    def on_days(count):
        run = structs.replace(calibration.runs[0], effort_change_deviation=0.001)
        days = [
            structs.replace(run, recorded=f"2026-03-{1 + day:02d}", effort_change=0.02 * day) for day in range(count)
        ]
        return replace(calibration, runs=tuple(days))

    few = SessionGains.assumed(on_days(FEWEST_SESSIONS - 1))
    assert few.deviation == ASSUMED
    assert "fewer than 3" in few.note(10.0, 0.4)
    assert "a drift of 1 % would change the mass by 4.0 %" in few.note(10.0, 0.4)
    known = SessionGains.assumed(on_days(FEWEST_SESSIONS))
    assert known.deviation == pytest.approx(np.hypot(0.02, LEAST))
    assert SessionGains.assumed(on_days(FEWEST_SESSIONS), 0.03).deviation == 0.03


def test_runs_keep_their_factors_in_the_file(calibration):
    """A file without them, of an older version, is read; nothing is known of its sessions then."""
    text = format_calibration(calibration)
    again = parse_calibration(text)
    assert [run.effort_change for run in again.runs] == [run.effort_change for run in calibration.runs]
    assert max(abs(run.effort_change / run.effort_change_deviation) for run in again.runs) < 4.0
    older = "\n".join(line for line in text.splitlines() if not line.startswith("effort_change"))
    assert parse_calibration(older).session_drift is None


@pytest.mark.parametrize(
    ("found", "half_width", "said"),
    [
        # both know it equally well: half of 2 %, +- 2.77 % / 1.96, and an end at 1.645 deviations beyond it
        (0.02, 0.01 + 1.6449 * 0.02 * 0.5**0.5, False),
        (-0.02, 0.01 + 1.6449 * 0.02 * 0.5**0.5, False),
        # nothing found: two-sided
        (0.0, 1.96 * 0.02 * 0.5**0.5, False),
        (0.0846, 0.0423 + 1.6449 * 0.02 * 0.5**0.5, False),
        # three deviations from what was known: the motion alone
        (-0.0852, 0.0852 + 1.6449 * 0.02, True),
    ],
)
def test_what_a_motion_says_and_the_prior_make_one_interval_from_zero(found, half_width, said):
    """It says so itself from three deviations on."""
    left = SessionGains(0.0, 0.02, "as stated").beside(found, 0.02)
    assert left.log_factor == 0.0
    assert 1.96 * left.deviation == pytest.approx(half_width, rel=1e-3)
    contradicts = "the run indicates -8.2 %, which contradicts 2 %, as stated"
    assert left.origin == (contradicts if said else "from 2 %, as stated, and from the run itself")


def test_a_measured_factor_is_not_weakened_by_the_run():
    measured = SessionGains(-0.03, 0.002, "measured")
    assert measured.beside(0.05, 0.001) is measured
