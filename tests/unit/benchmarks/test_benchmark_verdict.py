"""Criteria are printed with their results and counted."""

from __future__ import annotations

from benchmarks.results.tally import Tally


def test_one_criterion_not_met_fails_the_program(capsys):
    tally = Tally()
    tally.judge("mass within 1 %", "98 of 100", met=True)
    tally.postpone("gains", "no data here")
    assert tally.finish() == 0
    tally.judge("centre within 3 mm", "80 of 100", met=False)
    assert tally.finish() == 1
    text = capsys.readouterr().out
    assert "mass within 1 %: 98 of 100: met" in text
    assert "gains: not yet, no data here" in text
    assert "1 met, 1 not met, 1 not yet" in text
    assert "NOT met: centre within 3 mm" in text
