"""A payload over time: rows, document and marks of the drawing, with windows of chosen numbers."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.report.figures import figure_file, mass_figure
from armload_identification.results.payload_over_time import PayloadOverTime

pytestmark = pytest.mark.pure


def window(start_s, mass_kg=None, determined=(True, True, True)):
    found = None
    if mass_kg is not None:
        found = SimpleNamespace(
            parameters=SimpleNamespace(mass_kg=mass_kg, center_of_mass_m=np.array([0.01, -0.02, 0.1])),
            uncertainty=SimpleNamespace(
                determined=np.array([True, *determined, False]), half_width_95=np.array([0.05, 1.0, 2.0, 3.0])
            ),
        )
    return SimpleNamespace(start_s=start_s, end_s=start_s + 10.0, found=found, refusal="" if found else "too slow")


SHIFT = PayloadOverTime(
    "arm",
    (window(0.0, 4.2), window(10.0), window(20.0, -0.0001, (True, False, True))),
    SimpleNamespace(path=Path("runs/shift.mcap")),
)


def test_each_window_has_a_row_with_its_payload_or_why_there_is_none():
    assert SHIFT.table().rows == [
        ("0.0 to 10.0", "4.200 +- 0.050", "10, -20, 100", ""),
        ("10.0 to 20.0", "", "", "too slow"),
        ("20.0 to 30.0", "0.000 +- 0.050", "10, ?, 100", ""),
    ]
    assert "What arm carried" in SHIFT.table().title


def test_the_document_has_no_number_for_what_is_not_determined():
    document = SHIFT.to_dict()
    first, second, third = document["windows"]
    assert (document["robot"], document["recording"]) == ("arm", "runs/shift.mcap")
    assert first == {
        "start_s": 0.0, "end_s": 10.0, "mass_kg": 4.2, "half_width_95_kg": 0.05, "refusal": None,
        "center_of_mass_m": [0.01, -0.02, 0.1],
    }  # fmt: skip
    assert second["mass_kg"] is second["half_width_95_kg"] is second["center_of_mass_m"] is None
    assert second["refusal"] == "too slow"
    assert third["center_of_mass_m"] == [0.01, None, 0.1]


def test_masses_are_drawn_in_the_middle_of_their_windows_and_gaps_where_there_is_none(monkeypatch):
    drawn = {}

    def figure(marks, gaps, title):
        drawn.update(marks=marks, gaps=gaps, title=title)

    monkeypatch.setattr(mass_figure, "mass_figure", figure)
    monkeypatch.setattr(figure_file, "write_figure", lambda path, figure: drawn.update(path=path))
    SHIFT.picture("shift.png")
    assert drawn["marks"] == [(5.0, 4.2, 0.05), (25.0, -0.0001, 0.05)]
    assert drawn["gaps"] == [(10.0, 20.0)]
    assert drawn["title"] == "arm: shift.mcap"
    assert drawn["path"] == Path("shift.png")
