"""How much of a motion tells about a payload: which joints move long enough, and what is asked for otherwise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import EstimationError
from armload_identification.verdict.recording_checks.motion_quality import MotionQuality

pytestmark = pytest.mark.pure


def quality(moving_s, brisk_rad_s=None):
    moving = np.array(moving_s, dtype=float)
    return MotionQuality(moving, np.full(moving.size, 0.3) if brisk_rad_s is None else np.array(brisk_rad_s))


def measured(velocity, reversal=0.001, valid=None, periods=1):
    velocity = np.asarray(velocity, dtype=float)
    motion = SimpleNamespace(
        states=SimpleNamespace(velocity_rad_s=velocity),
        valid=np.ones(len(velocity), dtype=bool) if valid is None else valid,
        interval_s=0.1,
        periods=periods,
    )
    return MotionQuality.of(motion, SimpleNamespace(reversal_speed_rad_s=np.full(velocity.shape[1], reversal)))


def test_time_counts_while_a_joint_is_fast_in_either_direction():
    velocity = np.zeros((100, 2))
    velocity[:30, 0], velocity[30:70, 0], velocity[:, 1] = 1.0, -1.0, 1e-4
    np.testing.assert_allclose(measured(velocity).moving_s, [7.0, 0.0])
    np.testing.assert_allclose(measured(velocity, valid=np.arange(100) < 40).moving_s, [4.0, 0.0])
    np.testing.assert_allclose(measured(velocity, periods=3).moving_s, [21.0, 0.0])


def test_a_joint_that_is_never_fast_is_asked_for_no_more_than_half_its_peak():
    slow, fast = measured(np.ones((2, 1)), 1e-4).brisk_rad_s, measured(np.ones((2, 1)), 10.0).brisk_rad_s
    assert slow < fast <= 0.3
    assert measured(np.ones((2, 1)), 2e-4).brisk_rad_s == pytest.approx(2.0 * slow)


def test_what_is_missing_names_the_joints_and_the_slowest_of_their_speeds():
    assert quality([5.0, 6.0]).missing == ""
    missing = quality([9.0, 4.9, 0.0], [0.1, 0.25, 0.2]).missing
    assert "joints 2 and 3 at 0.2 rad/s for 10 s" in missing


def test_standstill_and_one_joint_alone_are_refused_with_what_is_missing():
    with pytest.raises(EstimationError, match=r"a\.csv: the arm is at rest.*move joints 1 to 3"):
        quality([0.0, 0.0, 0.0]).require_enough("a.csv")
    with pytest.raises(EstimationError, match="only joint 2 moves"):
        quality([0.0, 20.0, 0.0]).require_enough("a.csv")
    quality([20.0, 20.0, 0.0]).require_enough("a.csv")
    quality([20.0]).require_enough("a.csv")


@pytest.mark.parametrize(("mass_kg", "negative"), [(-2.1, True), (-1.9, False), (-2.0, False), (0.1, False)])
def test_a_mass_below_its_interval_has_another_cause_than_little_motion(mass_kg, negative):
    error = quality([9.0, 1.0]).undetermined("a.csv", mass_kg, 2.0)
    assert ("negative" in str(error)) is negative
    assert ("move joint 2" in str(error)) is not negative
    assert (error.mass_kg, error.half_width_kg) == (mass_kg, 2.0)


@pytest.mark.parametrize(
    ("mass_kg", "cause"), [(1.9, "nothing is mounted"), (2.1, "the payload is light for this arm")]
)
def test_where_every_joint_moved_only_a_longer_or_an_unloaded_run_helps(mass_kg, cause):
    said = str(quality([9.0, 9.0]).undetermined("a.csv", mass_kg, 2.0))
    assert f"Either {cause}, or the motion is insufficient: record a longer run, or add an unloaded run" in said
