"""The difference of two runs by their phases, and a run minus a prediction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.signals.load_signal import load_signal, without_body
from armload_identification.signals.recorded_run import Run

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    """A loaded and an unloaded run, each with a part of its phases."""
    trajectory = pinocchio_arm.trajectory(period_s=5.0)
    whole = [pinocchio_arm.run(trajectory, load, seed=3 + load, periods=1) for load in (True, False)]

    def runs(first=slice(None), second=slice(None), truncated=(False, False)):
        made = []
        for run, rows, cut in zip(whole, (first, second), truncated, strict=True):
            part = run.rows(rows)
            made.append(Run.of(replace(part, source=replace(part.source, truncated=cut)), pinocchio_arm.transmission))
        return made

    return runs


@pytest.mark.parametrize(
    ("first", "second"),
    [(slice(0, 400), slice(0, 400)), (slice(100, 400), slice(0, 450)), (slice(0, 400), slice(50, 450))],
)
def test_runs_of_less_than_a_period_are_laid_over_each_other_by_their_phases(runs, first, second):
    """Both were stamped at the same phases, so each sample of one belongs to the sample of the other at its time."""
    signal = load_signal(*runs(first, second))
    assert not signal.periodic
    assert signal.periods == (1, 1)
    assert signal.shift_s == pytest.approx(0.0, abs=1e-6)
    assert (signal.mismatch_rad < 1e-3).all()


@pytest.mark.parametrize(
    ("first", "second", "truncated", "text"),
    [
        (slice(0, 200), slice(150, 400), (False, False), "share 0.49 s of their excitation, because loaded.mcap ends"),
        (slice(150, 400), slice(0, 200), (False, True), "because unloaded.mcap ends there: the file is truncated. Rec"),
        (
            slice(0, 100),
            slice(300, 400),
            (False, False),
            "share 0 s of their excitation, because loaded.mcap ends there.",
        ),
    ],
)
def test_runs_that_share_too_little_of_their_excitation_are_refused(runs, first, second, truncated, text):
    with pytest.raises(RecordingError) as caught:
        load_signal(*runs(first, second, truncated))
    assert text in str(caught.value)


def test_a_second_in_common_is_enough(runs):
    signal = load_signal(*runs(slice(0, 250), slice(145, 400)))
    assert 0.5 < signal.time_s[-1] < 1.1


def test_a_prediction_has_no_noise_and_no_periods(runs):
    motion = runs()[0].motion
    body_nm = 0.25 * motion.torque_nm
    signal = without_body(motion, body_nm)
    np.testing.assert_allclose(signal.torque_nm, 0.75 * motion.torque_nm)
    np.testing.assert_allclose(signal.raw_nm, motion.raw_nm - body_nm)
    np.testing.assert_allclose(signal.noise_nm, motion.noise_nm)
    np.testing.assert_allclose(signal.averaged_noise_nm, motion.averaged_noise_nm)
    np.testing.assert_allclose(signal.smoothing_loss, motion.smoothing_loss)
    assert signal.periods == (1, 0)
    assert signal.shift_s == 0.0
    assert not signal.mismatch_rad.any()
