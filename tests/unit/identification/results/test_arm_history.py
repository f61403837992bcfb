"""An arm's history: its table and document, and without the libraries for figures."""

import sys
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.identification_errors import ExtraMissing
from armload_identification.pipeline.arm_drift import Monitored
from armload_identification.results.arm_history import ArmHistory


@pytest.mark.parametrize("output", [ArmHistory.picture, ArmHistory.report])
def test_without_matplotlib_the_error_names_the_extra(output, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    history = ArmHistory("arm", "", (), None, "arm.calibration.toml", None, ())
    with pytest.raises(ExtraMissing, match=r"arm over its runs needs Matplotlib.*'armload\[report\]'"):
        output(history, tmp_path / "drift.png")


def chart(level, values=(0.1, np.nan), outside=(False, True)):
    return SimpleNamespace(
        values=np.array(values), limit=np.array([0.5, np.nan]), level=np.array(level), outside=np.array(outside)
    )


class Warming:
    """Friction falls with the time at work: by 0.3 N m in the first minute to zero after an hour, on joint 1."""

    slope_nm = np.array([0.1, 0.0])

    def curve_nm(self, work_s):
        assert work_s.tolist() == [60.0]
        return np.array([[0.3, 0.0]])


def history(warming=None, findings=(), began=(datetime(2026, 3, 1, tzinfo=UTC),)):
    charts = {
        Monitored.FRICTION: (chart([0.4, 0.5]), chart([np.nan, np.nan])),
        Monitored.GAIN: (chart([-0.01, np.nan]), chart([0.002, 0.0])),
        Monitored.RESIDUAL: (chart([np.log(1.5), np.log(2.0)]), chart([np.nan, 0.0])),
    }
    run = SimpleNamespace(name="a.mcap", length_s=9.0, carried="box")
    drift = SimpleNamespace(
        charts=charts, friction_nm=np.array([4.0, 5.5]), warming=warming, findings=findings, runs=(run,), began=began,
        out_of_date=False,
    )  # fmt: skip
    left_out = (("b.mcap", "cut short"),)
    return ArmHistory("er50", "an arm", ("base", "elbow"), None, "arm.toml", drift, left_out)


def test_the_latest_known_level_of_every_joint_is_told():
    rows = history(Warming()).table().rows
    assert rows == [
        ("1 base", "4.00", "+0.50", "-1.00 %", "2.00", "-0.30"),
        ("2 elbow", "5.50", "", "+0.00 %", "1.00", ""),
    ]
    assert [row[5] for row in history().table().rows] == ["", ""]


def test_the_table_ends_with_the_changes_and_the_advice():
    found = SimpleNamespace(text="base: friction rose", alone=True)
    table = history(findings=(found,)).table()
    assert table.title == "er50: 1 run against arm.toml, present levels"
    assert table.sentences[0] == "base: friction rose"
    assert table.sentences[1].startswith("Single runs are off")


def test_the_document_has_ratios_of_residuals_and_null_for_what_is_unknown():
    text = "elbow: the residual doubled"
    found = SimpleNamespace(
        joint=1, quantity=Monitored.RESIDUAL, run=0, alone=False, before=0.0, after=np.log(2.0), text=text
    )
    friction = SimpleNamespace(
        joint=0, quantity=Monitored.FRICTION, run=0, alone=True, before=0.0, after=0.25, text="more"
    )
    document = history(Warming(), (found, friction)).to_dict()
    assert document["runs"] == [
        {"name": "a.mcap", "began": "2026-03-01T00:00:00+00:00", "length_s": 9.0, "carried": "box"}
    ]
    base, elbow = document["joints"]
    assert (base["friction_nm"], base["warm_up_nm"], elbow["warm_up_nm"]) == (4.0, -0.3, None)
    assert base["charts"]["friction"] == {
        "values": [0.1, None],
        "lower_limit": [-0.5, None],
        "upper_limit": [0.5, None],
        "level": [0.4, 0.5],
        "outside": [False, True],
    }
    assert base["charts"]["residual"]["level"] == pytest.approx([1.5, 2.0])
    first, second = document["findings"]
    assert (first["joint"], first["run"], first["before"], first["after"]) == (
        "elbow",
        "a.mcap",
        1.0,
        pytest.approx(2.0),
    )
    assert (second["figure"], second["before"], second["after"], second["alone"]) == ("friction", 0.0, 0.25, True)
    assert document["left_out"] == [{"name": "b.mcap", "reason": "cut short"}]
    assert history(began=()).to_dict()["runs"][0]["began"] is None
