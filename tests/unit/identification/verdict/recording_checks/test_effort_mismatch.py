"""Joint torque of one run and motor current of another are not used together."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.verdict.recording_checks.effort_mismatch import (
    effort_used,
    require_effort,
    require_same_effort,
)

pytestmark = pytest.mark.pure

TIME_S = np.linspace(0.0, 1.0, 21)
VALUES = np.ones((21, 2))


def run(name="run.csv", **efforts):
    recording = Recording.from_arrays(TIME_S, np.outer(TIME_S, [1.0, 2.0]), **efforts)
    return replace(recording, source=replace(recording.source, path=Path(name)))


TORQUE, CURRENT = run("torque.csv", torque_nm=VALUES), run("current.csv", current_a=VALUES)
BOTH = run("both.csv", torque_nm=VALUES, current_a=VALUES)


def test_of_both_the_torque_is_used():
    assert [effort_used(each) for each in (TORQUE, CURRENT, BOTH)] == [Effort.TORQUE, Effort.CURRENT, Effort.TORQUE]
    with pytest.raises(RecordingError):
        effort_used(run())


def test_an_arm_takes_what_it_was_calibrated_with():
    require_effort(TORQUE, Effort.TORQUE)
    require_effort(CURRENT, Effort.CURRENT)
    require_effort(BOTH, Effort.TORQUE)
    with pytest.raises(RecordingError, match=r"current\.csv: it contains motor current, but .* with joint torque"):
        require_effort(CURRENT, Effort.TORQUE)
    with pytest.raises(RecordingError, match=r"joint torque and motor current, of which the torque is used, but"):
        require_effort(BOTH, Effort.CURRENT)


def test_a_pair_is_of_one_quantity():
    require_same_effort(TORQUE, BOTH)
    require_same_effort(CURRENT, CURRENT)
    with pytest.raises(RecordingError, match=r"torque\.csv contains joint torque, and current\.csv contains motor"):
        require_same_effort(TORQUE, CURRENT)
