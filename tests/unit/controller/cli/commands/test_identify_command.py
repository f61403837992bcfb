"""`armload identify`: its options, and runs of an arm that carries nothing."""

from __future__ import annotations

import json

import pytest
import typer

from armload_controller.cli.commands.identify_command import PriorKnowledge, _number_or_range
from armload_identification.files.payload_file import read_payload
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.recording.file_reading import read_recording_file


@pytest.fixture(scope="module")
def halves(recorded_er50, tmp_path_factory):
    """Two runs of an empty arm in tables: the halves of a recording, whose periods are alike."""
    run = read_recording_file(recorded_er50 / "runs" / "today" / "unloaded_identification.mcap")
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


# Options ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "value"), [("2.1", 2.1), ("1..3", (1.0, 3.0)), ("-0.05..0.1", (-0.05, 0.1))])
def test_a_number_or_a_range(text, value):
    assert _number_or_range(text) == value


@pytest.mark.parametrize("text", ["", "1..2..3", "1...3", "a", "1-3", ".."])
def test_what_is_neither_a_number_nor_a_range(text):
    with pytest.raises(typer.BadParameter, match=r"expected a number such as 2\.1, or a range such as 1\.\.3"):
        _number_or_range(text)


def test_only_what_is_stated_is_known(recorded_er50):
    assert PriorKnowledge().known() is None
    assert PriorKnowledge(cad_share=0.1).known() is None
    assert PriorKnowledge(mass_kg=2.0).known().mass_kg == 2.0
    assert PriorKnowledge(symmetric=True).known().symmetric
    payload = recorded_er50 / "runs" / "today" / "payload.toml"
    known = PriorKnowledge(cad=payload).known()
    assert known.cad.mass_kg == pytest.approx(read_payload(payload).model.mass_kg)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--picture", "a.svg"), "needs --every"),
        (("--every", "10s", "--unloaded", "b.mcap"), "cannot be combined with --every, which gives a mass for each"),
        (("--minus", "tool", "--mass-kg", "2"), "cannot be combined with --minus: it is about the whole load"),
        (("--every", "0s"), "above zero"),
    ],
)
def test_options_that_do_not_go_together(armload, tmp_path, monkeypatch, words, text):
    monkeypatch.chdir(tmp_path)
    result = armload("identify", "er50", "--loaded", "a.mcap", *words, columns=500)
    assert result.exit_code == 2, (result.output, result.exception)
    assert text in result.output


def test_recordings_are_read_and_given_in_their_order(armload, tmp_path, monkeypatch):
    read, asked = [], []

    def identify(arm, loaded, unloaded, **known):
        asked.append((loaded, unloaded, known))
        raise EstimationError("enough")

    def read_of(arm, file, choice):
        read.append((file.name, choice.between_s))
        return file.name

    monkeypatch.setattr("armload_controller.config.robot_recordings.read_of", read_of)
    monkeypatch.setattr("armload_controller.analysis.robot_identification.identify", identify)
    files = ("--loaded", "a.mcap", "--unloaded", "b.mcap", "--validation", "c.mcap", "d.mcap")
    result = armload("identify", "er50", *files, "--between", "1", "5", "--tolerance", "0.05", "0.02")
    assert str(result.exception) == "enough", (result.output, result.exception)
    assert [name for name, _ in read] == ["a.mcap", "b.mcap", "c.mcap", "d.mcap"]
    assert [between_s is None for _, between_s in read] == [False, False, True, True]
    ((loaded, unloaded, known),) = asked
    assert (loaded, unloaded, known["validation"]) == ("a.mcap", "b.mcap", ("c.mcap", "d.mcap"))
    assert (known["tolerance"].mass_share, known["tolerance"].center_m) == (0.05, 0.02)
    assert known["known"] is known["minus"] is None
    asked.clear()
    armload("identify", "er50", "--loaded", "a.mcap")
    assert asked[0][:2] == ("a.mcap", None)
    assert asked[0][2]["validation"] is None
