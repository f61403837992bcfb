"""The runs of a calibration: from a table, or from what the recordings say of themselves."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot_runs import (
    is_run_table,
    listed_runs,
    masses_otherwise_recorded,
    read_runs,
    runs_of_commissioning,
)
from armload_controller.control_errors import CommissioningError
from armload_identification.files.payload_file import write_payload
from armload_identification.identification_errors import RunTableError
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_format import RUN_ATTACHMENT

TIME_S = np.linspace(0.0, 2.0, 41)
PLAIN = Recording.from_arrays(TIME_S, np.outer(np.sin(TIME_S), np.ones(6)), torque_nm=np.ones((41, 6)))


def recorded(name, **said):
    """A recording in the folder `box` that says this of itself."""
    attachments = {RUN_ATTACHMENT: json.dumps(said)} if said else {}
    return replace(PLAIN, source=replace(PLAIN.source, path=Path("box", name), attachments=attachments))


LOADED, EMPTY = recorded("a.mcap", load="loaded", mass_kg=4.2), recorded("b.mcap", load="unloaded")


class Arm:
    """Accepts all recordings but one."""

    def own(self, run):
        if run.source.path.name == "other.mcap":
            raise CommissioningError(f"{run.source.path}: it is of another arm")
        return run


@pytest.mark.parametrize(
    ("content", "is_one"),
    [
        (b"recording,mounting\n", True),
        (b"\xef\xbb\xbfmounting; recording \n", True),
        (b"mass_kg\trecording\n", True),
        (b"recordings,mounting\n", False),
        (b"time,q1\nrecording\n", False),
        (b"", False),
    ],
)
def test_a_table_of_runs_is_told_by_its_first_line(tmp_path, content, is_one):
    path = tmp_path / "x"
    path.write_bytes(content)
    assert is_run_table(path) is is_one
    assert not is_run_table(tmp_path / "missing")


def test_recordings_say_what_they_carried_in_the_folder_of_a_commissioning():
    steps = []
    found = read_runs(Arm(), [LOADED, EMPTY, recorded("other.mcap", load="loaded")], lambda *step: steps.append(step))
    assert [run.mounting for run in found.runs] == ["box", ""]
    assert found.weighed["box"].mass_kg == 4.2
    assert found.left_out == (("other.mcap", "it is of another arm"),)
    assert steps == [(1, 3), (2, 3), (3, 3)]


def test_a_recording_that_says_nothing_needs_a_table():
    for run in (recorded("c.mcap"), recorded("c.mcap", load="heavy")):
        with pytest.raises(RunTableError, match="give a table of runs"):
            runs_of_commissioning([run], None)


def test_a_table_says_what_each_carried(tmp_path, make_subject, monkeypatch):
    write_payload(tmp_path / "known.toml", make_subject().payload)
    table = tmp_path / "runs.csv"
    table.write_text(
        "recording,mounting,mass_kg,payload\na.mcap,,,\nb.mcap,box,2.5,\nc.mcap,box,,\nd.mcap,tool,,known.toml\n"
        "e.mcap,heavy,3.0,known.toml\n"
    )
    monkeypatch.setattr("armload_controller.config.robot_runs.recording_of", lambda arm, run, argument: recorded("x"))
    found = read_runs(Arm(), [table])
    assert [run.mounting for run in found.runs] == ["", "box", "box", "tool", "heavy"]
    known = make_subject().payload.model
    assert {name: each.mass_kg for name, each in found.weighed.items()} == pytest.approx(
        {"box": 2.5, "tool": known.mass_kg, "heavy": 3.0}
    )
    (listed, from_table), (plain, from_none) = listed_runs([table]), listed_runs([LOADED])
    assert from_table
    assert not from_none
    assert len(listed) == 5
    assert plain[0][0] is LOADED
    with pytest.raises(RunTableError, match="cannot be combined with recordings"):
        listed_runs([table, LOADED])


def test_a_mass_that_was_entered_again_counts_and_the_old_one_does_not():
    found = runs_of_commissioning([LOADED, EMPTY], 4.5)
    assert found.weighed["box"].mass_kg == 4.5
    assert runs_of_commissioning([LOADED, EMPTY], None).weighed == {}
    assert masses_otherwise_recorded([LOADED, EMPTY], 4.5) == (4.2,)
    assert masses_otherwise_recorded([LOADED, EMPTY], 4.2) == ()
    other = recorded("c.mcap", load="loaded", mass_kg=3.9)
    assert masses_otherwise_recorded([LOADED, other, LOADED], None) == (3.9, 4.2)
