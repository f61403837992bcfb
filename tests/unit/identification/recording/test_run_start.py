"""The start of a run as its recording states it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_format import RUN_ATTACHMENT
from armload_identification.recording.run_start import run_start_text

pytestmark = pytest.mark.pure

EPOCH_S = 1772359200.0  # 2026-03-01T10:00:00 UTC


def run_at(first_s, created=None, between_s=None):
    time_s = first_s + 0.01 * np.arange(200)
    position = np.sin(np.outer(time_s - first_s, [3.0, 5.0]))
    run = Recording.from_arrays(time_s, position, torque_nm=position)
    attachments = {} if created is None else {RUN_ATTACHMENT: json.dumps({"created": created})}
    return replace(run, source=replace(run.source, attachments=attachments, between_s=between_s))


@pytest.mark.parametrize(
    ("run", "start"),
    [
        (run_at(0.0), ""),
        (run_at(12345.0), ""),
        (run_at(EPOCH_S), "2026-03-01T10:00:00+00:00"),
        (run_at(EPOCH_S, "2026-03-02T08:30:00+01:00"), "2026-03-02T07:30:00+00:00"),
        (run_at(0.0, "2026-03-02T08:30:00"), "2026-03-02T08:30:00+00:00"),
        (run_at(EPOCH_S, "in March"), "2026-03-01T10:00:00+00:00"),
        (run_at(EPOCH_S, "1970-01-01T00:00:10+00:00"), "2026-03-01T10:00:00+00:00"),
        (run_at(0.0, "9999-12-31T23:59:59+00:00", (3600.0, 3700.0)), ""),
        (run_at(0.0, "2026-03-02T08:30:00+00:00", (3600.0, 3700.0)), "2026-03-02T09:30:00+00:00"),
    ],
)
def test_the_metadata_state_it_or_else_time_stamps_since_1970(run, start):
    assert run_start_text(run) == start


def test_a_selected_part_begins_later_than_its_file(tmp_path):
    path = tmp_path / "log.csv"
    time_s = EPOCH_S + 0.01 * np.arange(20_000)
    position = np.sin(np.outer(time_s - EPOCH_S, [3.0, 5.0]))
    np.savetxt(
        path, np.column_stack([time_s, position, position]), delimiter=",", header="t,q1,q2,tau1,tau2", comments=""
    )
    part = read_recording_file(path, between_s=(90.0, 120.0))
    assert run_start_text(part) == "2026-03-01T10:01:30+00:00"
