"""Facts of a recording as text, table and document."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cli.output.recording_output import joint_table, pair_text, recording_document, survey_text
from armload_identification.pipeline.recording_survey import RecordingSurvey
from armload_identification.recording.recording import Recording

pytestmark = pytest.mark.pure

TIME_S = np.linspace(0.0, 2.0, 21)
RUN = Recording.from_arrays(TIME_S, np.column_stack([np.sin(TIME_S), np.cos(TIME_S)]), torque_nm=np.ones((21, 2)))


def facts(recording=RUN, **changes):
    source = replace(recording.source, path=Path("run.csv"), kind="csv", rows_read=21)
    survey = RecordingSurvey(
        recording=replace(recording, source=source),
        duration_s=2.0,
        rate_hz=10.0,
        holes=0,
        longest_hole_s=0.0,
        position_rad=np.array([[-0.0001, 1.0], [-0.5, 0.25]]),
        speed_rad_s=np.array([0.75, 1.5]),
        effort=np.array([[0.5, 1.25], [-3.0, 2.0]]),
        moving_s=(0.25, 1.75),
        period_s=None,
        periods=0,
        interruptions=0,
        missing=(),
    )
    return replace(survey, **changes)


def line(survey, word):
    (found,) = [text for text in survey_text(survey).splitlines() if text.strip().startswith(word)]
    return found.split(word, 1)[1].strip()


def test_a_plain_recording():
    survey = facts()
    assert survey_text(survey).splitlines()[0] == "run.csv"
    assert line(survey, "format") == "csv"
    assert line(survey, "rows") == "21"
    assert line(survey, "time") == "2 s, 10 rows per second, no gaps"
    assert line(survey, "joints") == "2, not named"
    assert line(survey, "effort") == "joint torque"
    assert line(survey, "motion") == "from 0.25 to 1.75 s, not periodic"


@pytest.mark.parametrize(
    ("changes", "word", "said"),
    [
        ({"holes": 1, "longest_hole_s": 0.5}, "time", "1 gap, the longest 0.5 s"),
        ({"holes": 2, "longest_hole_s": 0.5}, "time", "2 gaps, the longest 0.5 s"),
        ({"effort": None}, "effort", "none"),
        ({"moving_s": None}, "motion", "none"),
        ({"period_s": 5.0, "periods": 3}, "motion", "3 whole periods of 5 s, found in the motion"),
        ({"period_s": 5.0, "interruptions": 1}, "motion", "found in the motion, interrupted once"),
        ({"period_s": 5.0, "interruptions": 2}, "motion", "found in the motion, interrupted 2 times"),
        ({"missing": ("torque",)}, "missing", "torque"),
    ],
)
def test_what_is_special_is_said(changes, word, said):
    assert line(facts(**changes), word).endswith(said)


def test_rows_that_were_left_out_are_counted_by_reason():
    source = replace(RUN.source, reasons={"not finite": 2, "repeated": 1}, truncated=True)
    survey = facts(replace(RUN, source=source))
    assert line(survey, "rows") == "21, 3 left out (2 not finite, 1 repeated)"
    assert line(survey, "format") == "csv, cut short"


def test_a_run_of_armload_says_what_it_is_of():
    class Source(SimpleNamespace):
        def run(self):
            return {"robot": "er50", "load": "loaded", "role": "", "created": None}

    survey = facts()
    own = SimpleNamespace(
        n=2,
        joint_names=("a", "b"),
        excitation=object(),
        source=Source(
            path="run.mcap", kind="mcap", truncated=False, rows_read=1, rows_dropped=0, reasons={}, sha256="0"
        ),
    )
    survey = replace(survey, recording=own, effort=None, period_s=5.0)
    assert line(survey, "format") == "mcap: robot er50, load loaded"
    assert line(survey, "joints") == "2: a, b"
    assert line(survey, "motion").endswith("of a known excitation")
    (found,) = recording_document([survey], None)["recordings"]
    assert (found["robot"], found["created"]) == ("er50", None)
    assert [joint["name"] for joint in found["joints"]] == ["a", "b"]
    assert found["joints"][0]["effort"] == [None, None]


def test_a_row_for_each_joint():
    table = joint_table(facts())
    assert table.rows == [("1", "0.000 to 1.000", "0.750", "0.5 to 1.25"), ("2", "-0.500 to 0.250", "1.500", "-3 to 2")]
    assert table.headings[-1] == "joint torque, N m"
    assert len(joint_table(facts(effort=None)).headings) == 3
    current = Recording.from_arrays(TIME_S, RUN.position_rad, current_a=np.ones((21, 2)))
    assert joint_table(facts(current)).headings[-1] == "motor current, A"


def test_the_document_has_the_same_numbers():
    document = recording_document([facts(), facts()], "other motions")
    assert document["pair"] == {"fits": False, "problem": "other motions"}
    assert recording_document([facts(), facts()], None)["pair"]["fits"] is True
    assert recording_document([facts()], None)["pair"] is None
    found = document["recordings"][0]
    assert (found["file"], found["rows_read"], found["duration_s"], found["periods"]) == ("run.csv", 21, 2.0, 0)
    second = found["joints"][1]
    assert second == {"name": None, "position_rad": [-0.5, 0.25], "speed_rad_s": 1.5, "effort": [-3.0, 2.0]}


def test_whether_it_is_sufficient():
    assert "identify can use them as a pair" in pair_text([facts(), facts()], None)
    assert pair_text([facts(), facts()], "other motions") == "not a pair: other motions"
    assert "not sufficient" in pair_text([facts(missing=("torque",))], None)
    assert "requires a second run" in pair_text([facts()], None)
