"""The page of the first day: short, numbered, and followed word by word on a simulated arm."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.run_format import LATENESS_ATTACHMENT
from tests.short_commissioning import RECORDINGS, write_short_robot

PAGE = Path(__file__).resolve().parents[3] / "docs" / "first-day.md"
pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="not a checkout: the documentation is not installed")
ON_A_BUS = ("drives scan", "init", "drives show")
"""Commands that need a bus, a URDF or a person."""


def page_commands():
    return re.findall(r"^ +\$ armload (.*)$", PAGE.read_text("utf-8"), re.MULTILINE)


def test_the_page_is_short_and_its_steps_are_numbered_with_one_command_each():
    text = PAGE.read_text("utf-8")
    assert len(text.split()) <= 1000
    steps = re.split(r"^(?=\d+\. )", text.split("## After an interruption")[0], flags=re.MULTILINE)[1:]
    assert [int(step.split(".")[0]) for step in steps] == list(range(1, len(steps) + 1))
    assert max(step.count("$ armload") for step in steps) == 1


@pytest.mark.long
def test_the_page_is_followed_on_a_simulated_arm(armload, tmp_path, monkeypatch):
    """After each half an interruption's partial recording is left behind, and the command is given again."""
    monkeypatch.chdir(tmp_path)
    write_short_robot(tmp_path).rename("arm.toml")
    followed = [words for words in page_commands() if not words.startswith(ON_A_BUS)]
    assert [" ".join(words.split()[:2]) for words in followed] == [
        "drives check", "commission arm.toml", "drives check", "commission arm.toml",
        "feedforward trial", "feedforward compare",
    ]  # fmt: skip
    for words in followed:
        if words.startswith("feedforward"):
            put_the_weighed_payload(tmp_path / "runs" / "first" / "payload.toml")
        done = armload(*words.split())
        assert done.exit_code in (0, 3), (words, done.output, done.exception)
        if words.startswith("commission"):
            last = tmp_path / "runs" / "first" / f"{words.split()[3]}_validation.mcap"
            last.rename(last.with_suffix(".partial.mcap"))
            again = armload(*words.split())
            assert again.exit_code in (0, 3), (words, again.output, again.exception)
            assert ": identification" not in again.output, "only the missing run is repeated"
    recordings = list((tmp_path / "runs" / "first").glob("*.mcap"))
    assert {path.name for path in recordings} >= RECORDINGS
    report = (tmp_path / "runs" / "first" / "report.html").read_text("utf-8")
    for path in (path for path in recordings if path.name in RECORDINGS):
        late = json.loads(read_recording(path).source.attachments[LATENESS_ATTACHMENT])
        assert late["cycles"][0] > 0 == sum(late["cycles"][1:]), "nothing is late in virtual time"
        assert f"of {late['cycles'][0]} cycles" in report
    assert (tmp_path / "feedforward.svg").is_file()


def put_the_weighed_payload(path):
    """The simulated payload in place of that of four seconds of motion, which need not determine all of it."""
    body = load_robot("prbt").simulation.payload("block")
    values = np.stack([body.values, body.values], axis=1)
    known = np.ones(10, dtype=bool)
    path.unlink(missing_ok=True)
    write_payload(path, PayloadResult("flange", body, known, values, np.ones(6), np.ones(6), Provenance("0", "0", {})))
