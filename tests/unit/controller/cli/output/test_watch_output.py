"""A watched arm on the console: a line for each moment, and a table with the time in motion of each joint."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.payload_events import PayloadEvent
from armload_controller.analysis.payload_watch import HeardBus, WatchedMoment
from armload_controller.cli.output.watch_output import moment_table, moment_text, shown_moments
from armload_identification.contact.force_watch import Force

NOTED_S, SHOWN_S, SILENT_S = 10.0, 3.0, 3.0

pytestmark = pytest.mark.pure

HEARD = HeardBus(500, (0, 0), enabled=True, silent_s=0.0)


def payload(moved_s=(5.0, 12.0), determined=(True, True, True, True), changes=0, gains=None):
    return SimpleNamespace(
        mass_kg=4.2,
        half_width_95=np.array([0.05, 0.002, 0.003, 0.004]),
        values=np.array([4.2, 0.01, -0.02, 0.1]),
        determined=np.array(determined),
        moving_s=np.array(moved_s),
        changes=changes,
        gains=gains,
        drifted_kg=0.1,
    )


def test_mass_and_centre_with_their_intervals():
    text = moment_text(WatchedMoment(12.34, payload()))
    assert text == "      12.3 s    4.200 +- 0.050 kg  centre 10 +- 2, -20 +- 3, 100 +- 4 mm"
    assert moment_text(WatchedMoment(None, payload())).startswith(" " * 14 + "  4.200")


def test_what_is_not_determined_is_no_number():
    text = moment_text(WatchedMoment(0.0, payload(determined=(True, True, False, True))))
    assert text.endswith("centre 10 +- 2, ?, 100 +- 4 mm")
    assert "centre" not in moment_text(WatchedMoment(0.0, payload(determined=(True, False, False, False))))


def test_a_payload_is_shown_after_some_motion_of_any_joint():
    short = moment_text(WatchedMoment(1.0, payload(moved_s=(0.0, SHOWN_S - 0.1))))
    assert short.endswith(f"no estimate yet: {SHOWN_S - 0.1:.1f} s of motion of {SHOWN_S:g} s needed")
    assert "kg" in moment_text(WatchedMoment(1.0, payload(moved_s=(0.0, SHOWN_S))))


def test_while_something_acts_the_mass_is_that_of_before():
    force = next(kind for kind in Force if kind is not Force.FREE)
    text = moment_text(WatchedMoment(1.0, payload(), force=force))
    assert f"held: {force}" in text
    assert "centre" not in text


@pytest.mark.parametrize(
    ("bus", "said"),
    [
        (HeardBus(0, (0, 0), enabled=False, silent_s=9.0), "nothing received from the arm yet"),
        (
            HeardBus(5, (0, 0), enabled=True, silent_s=SILENT_S + 1.0),
            f"nothing has been received for {SILENT_S + 1:.0f} s",
        ),
        (HeardBus(5, (0, 0), enabled=False, silent_s=SILENT_S), "the drives are not enabled"),
        (HeardBus(5, (1, 2), enabled=False, silent_s=0.0), "the drives are not enabled  3 feedback frames missing"),
    ],
)
def test_why_there_is_no_estimate(bus, said):
    assert moment_text(WatchedMoment(1.0, payload(), bus=bus)).endswith(said)


def test_an_arm_that_is_only_recorded_counts_its_cycles():
    assert moment_text(WatchedMoment(1.0, None)).endswith(" 0 cycles")
    assert moment_text(WatchedMoment(1.0, None, bus=HEARD)).endswith(" 500 cycles")


def test_what_was_lost_and_told_is_said():
    told = SimpleNamespace(mass_kg=3.0)
    bus = HeardBus(495, (1, 0), enabled=True, silent_s=0.0, lost=5, told=told)
    text = moment_text(WatchedMoment(1.0, payload(), bus=bus))
    assert text.endswith("mm  1 feedback frames missing  5 of 500 cycles lost  the controller was told 3.000 kg")


def test_a_bar_is_full_after_twenty_seconds_of_motion():
    table = moment_table(
        WatchedMoment(1.0, payload(moved_s=(5.0, 40.0)), bus=HeardBus(5, (0, 7), True, 0.0)), "arm", ["a", "b"]
    )
    assert table.rows == [("a", "5.0", "#####" + "." * 15, "0"), ("b", "40.0", "#" * 20, "7")]
    assert table.title.startswith("arm: 1.0 s")
    (row,) = moment_table(WatchedMoment(None, None), "arm", ["a"]).rows
    assert row == ("a", "0.0", "." * 20, "0")


class Lines:
    """A screen that is no terminal."""

    as_json = False
    console = SimpleNamespace(is_terminal=False)

    def __init__(self):
        self.steps, self.results = [], []
        self.step, self.result = self.steps.append, self.results.append


def test_in_a_file_events_and_moments_are_lines_and_a_drift_is_noted_once_per_payload():
    screen = Lines()
    gains = SimpleNamespace(note=lambda mass_kg, drifted_kg: f"a drift means {drifted_kg} of {mass_kg}")
    event = PayloadEvent(7.0, "grasped", 2.0)
    with shown_moments(screen, "arm", ["a", "b"]) as show:
        show(WatchedMoment(1.0, payload(moved_s=(NOTED_S - 1.0, 0.0), gains=gains)))
        assert screen.steps == []
        show(WatchedMoment(2.0, payload(moved_s=(NOTED_S, 0.0), gains=gains), events=(event,)))
        show(WatchedMoment(3.0, payload(moved_s=(NOTED_S, 0.0), gains=gains)))
        assert screen.steps == [f"       7.0 s  {event}", "a drift means 0.1 of 4.2"]
        show(WatchedMoment(4.0, payload(moved_s=(NOTED_S, 0.0), gains=gains, changes=1)))
    assert len(screen.steps) == 3
    assert [text.split(" s")[0].strip() for text in screen.results] == ["1.0", "2.0", "3.0", "4.0"]
