"""Lines about a fleet: counts, the first of many, and how the others are found."""

from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from armload_controller.cli.output.fleet_output import problem_lines, suspicion_lines
from armload_controller.fleet.arm_runs import IN_FUTURE
from armload_controller.fleet.recording_row import RowOutcome

DAY = datetime(2026, 3, 1, tzinfo=UTC)


def problem(number, outcome=RowOutcome.REFUSED, error="cut short"):
    return SimpleNamespace(outcome=outcome, arm=f"arm {number}", loaded=f"{number}.mcap", error=error)


@pytest.mark.parametrize(("count", "shown", "more"), [(0, 0, None), (5, 5, None), (6, 5, 1), (9, 5, 4)])
def test_the_first_five_reasons_are_told_and_where_the_others_are(count, shown, more):
    lines = problem_lines(SimpleNamespace(problems=[problem(i) for i in range(count)]), Path("rows"))
    expected = [f"  refused: arm {i}: {i}.mcap: cut short" for i in range(shown)]
    expected += [f"  and {more} more: `armload fleet report rows` lists them"] if more else []
    assert lines == expected


def test_a_recording_is_named_once_and_what_failed_is_tried_again():
    problems = [problem(1, error="1.mcap: cut short"), problem(2, RowOutcome.FAILED)]
    assert problem_lines(SimpleNamespace(problems=problems), Path("rows")) == [
        "  refused: arm 1: 1.mcap: cut short",
        "  failed: arm 2: 2.mcap: cut short",
        "  what failed is tried again by the next run; what was refused, once its files change",
    ]


class Attention:
    """Attention for some arms."""

    def __init__(self, *arms, acknowledged=()):
        self.arms, self.acknowledged = arms, acknowledged

    def of(self, arm):
        return [SimpleNamespace(text=f"{arm} is odd"), SimpleNamespace(text="and more")]


def review(arms=0, absent=0, odd=(), problems=()):
    gone = [SimpleNamespace(arm=f"gone {i}", latest=DAY) for i in range(absent)]
    present = [SimpleNamespace(arm=f"arm {i}") for i in range(arms)]
    return SimpleNamespace(arms=present, absent=gone, odd=odd, problems=problems)


@pytest.mark.parametrize(
    ("arms", "suspicious", "first", "last"),
    [
        (1, 0, "to be inspected: none of 1 arm", None),
        (2, 1, "to be inspected: 1 of 2 arms", "  1. arm 0: arm 0 is odd"),
        (10, 10, "to be inspected: 10 of 10 arms", " 10. arm 9: arm 9 is odd"),
        (12, 12, "to be inspected: 12 of 12 arms", "     and 2 more: see the report"),
    ],
)
def test_the_first_ten_arms_are_told(arms, suspicious, first, last):
    lines = suspicion_lines(review(arms), Attention(*(f"arm {i}" for i in range(suspicious)), "gone 1"))
    assert lines[0] == first
    assert lines[1:][-1:] == ([last] if last else [])
    assert len(lines) == 1 + min(suspicious, 10) + (suspicious > 10)


@pytest.mark.parametrize(
    ("absent", "listed"),
    [(1, "gone 0 (2026-03-01);"), (11, "gone 9 (2026-03-01), 1 more;"), (10, "gone 9 (2026-03-01); removed")],
)
def test_absent_arms_are_in_one_line(absent, listed):
    _, line = suspicion_lines(review(absent=absent), Attention())
    assert line.startswith("no recent recording, not assessed: gone 0 (2026-03-01)")
    assert listed in line


def test_acknowledged_oddly_dated_and_lost_recordings_are_told():
    known = SimpleNamespace(arm="a", until="2026-04-01", why="new gripper")
    odd = [
        SimpleNamespace(arm="a", recording=f"{by}.mcap", recorded=DAY, dated_by=by) for by in (IN_FUTURE, "file's date")
    ]
    lost = [SimpleNamespace(arm=arm) for arm in "aab"]
    acknowledged = ((SimpleNamespace(text="a is odd"), known),)
    assert suspicion_lines(review(1, odd=odd, problems=lost), Attention(acknowledged=acknowledged))[1:] == [
        "a: a is odd; acknowledged until 2026-04-01: new gripper",
        f"odd date: a: {IN_FUTURE}.mcap is dated 2026-03-01 ({IN_FUTURE})",
        "odd date: a: file's date.mcap is dated 2026-03-01 (file's date), long after the others",
        "without a result: 3 recordings of 2 arms",
    ]
