"""`armload identify` on runs of an arm that carries nothing."""

from __future__ import annotations

import json

import pytest

from armload_identification.identification_errors import NoPayloadMass
from armload_identification.recording.file_reading import read_recording


@pytest.fixture(scope="module")
def halves(recorded_er50, tmp_path_factory):
    """Two runs of an empty arm in tables: the halves of a recording, whose periods are alike."""
    run = read_recording(recorded_er50 / "runs" / "today" / "unloaded_identification.mcap")
    folder = tmp_path_factory.mktemp("empty")
    middle = len(run.time_s) // 2
    files = []
    for name, rows in (("first", slice(0, middle)), ("second", slice(middle, None))):
        lines = ["time_s," + ",".join(f"{what}_{j}" for what in ("position_rad", "current_a") for j in range(1, 7))]
        for row in zip(run.time_s[rows], run.position_rad[rows], run.current_a[rows], strict=True):
            lines.append(",".join(f"{value:.9g}" for part in row for value in ([part] if part.ndim == 0 else part)))
        files.append(folder / f"{name}.csv")
        files[-1].write_text("\n".join(lines) + "\n")
    return files


def test_an_empty_arm_is_a_result(armload, halves, tmp_path):
    report, payload = tmp_path / "report.html", tmp_path / "payload.toml"
    pair = ("identify", "er50", "--loaded", halves[0], "--unloaded", halves[1])
    result = armload(*pair, "-o", payload, "--report", report)
    assert result.exit_code == 0, (result.output, result.exception)
    assert "er50: nothing mounted: " in result.output
    assert f"not written: {payload}" in result.output
    assert not payload.exists()
    assert "Nothing mounted: " in report.read_text("utf-8")
    assert "first.csv" in report.read_text("utf-8")
    document = json.loads(armload(*pair, "--json").stdout)
    assert abs(document["mass_kg"]) < 2.0 * document["half_width_95_kg"] < 0.5
    assert document["text"].startswith("nothing mounted")


def test_a_payload_is_not_judged_by_an_empty_arm(armload, halves, recorded_er50):
    payload = recorded_er50 / "runs" / "today" / "payload.toml"
    result = armload("validate", "er50", payload, "--loaded", halves[0], "--unloaded", halves[1])
    assert result.exit_code == 1
    assert isinstance(result.exception, NoPayloadMass)
    assert "first.csv: in this run, nothing mounted" in str(result.exception)
