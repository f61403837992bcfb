"""`armload watch`: where the joints come from, what is kept, and the drift of the gains on a recording."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from armload_controller.analysis import payload_watch
from armload_controller.analysis.payload_watch import WatchedMoment
from armload_controller.cli.arm_commands.watch_command import _show
from armload_controller.cli.screen import Screen
from armload_drivers.driver_errors import BusError


@pytest.mark.long
@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (("--gain-drift", "3%"), "from 3 %, as stated"),
        (("--reference", "unloaded_validation.mcap"), "(measured by unloaded_validation.mcap)."),
        (("--reference", "loaded_validation.mcap", "--reference-mass", "9.814"), "(measured by loaded_validation"),
    ],
)
def test_a_drift_is_stated_or_measured(armload, recorded_er50, monkeypatch, stated, said):
    monkeypatch.chdir(recorded_er50 / "runs" / "today")
    monkeypatch.setattr(payload_watch, "NOTED_S", 8.0)  # the joints move for 9 s of these 20
    run = armload("watch", "er50", "loaded_identification.mcap", "--calibration", "arm.calibration.toml", *stated)
    assert run.exit_code == 0, run.exception
    assert said in " ".join(run.output.split())


# The command without an arm ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--follow",), "requires a RECORDING; a moving arm is always followed"),
        (("a.csv", "--record", "b.mcap"), "applies to an arm that moves now and cannot be combined with a RECORDING"),
        (("a.csv", "--rtde", "robot"), "applies to an arm that moves now and cannot be combined with a RECORDING"),
        (("--rtde", "robot", "--ros2", "/joints"), "the joints come from one place; give one of them"),
        (("--rtde", "robot", "--effort", "torque"), "requires --ros2"),
        (("--rtde", "robot", "--load", "loaded"), "requires --record"),
        (("--rtde", "robot", "--record", "b.mcap", "--report", "c.html"), "requires a calibrated arm; without"),
    ],
)
def test_options_that_do_not_go_together(armload, tmp_path, monkeypatch, words, text):
    monkeypatch.chdir(tmp_path)
    result = armload("watch", "er50", *words, columns=500)
    assert result.exit_code == 2, (result.output, result.exception)
    assert text in result.output
    assert list(tmp_path.iterdir()) == []


class Feed:
    """Joints that move for some cycles, and then fail or end."""

    name, what_is_sent, effort = "can7", "positions are sent", None

    def __init__(self):
        self.published = []

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        pass

    cycles = ()

    def publish(self, moment):
        self.published.append(moment)


class Kept:
    """A recorder that has kept some rows."""

    partial = "b.partial.mcap"

    def __init__(self, rows):
        self.rows = rows

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        pass


@pytest.fixture
def live(armload, monkeypatch, tmp_path):
    """Watch er50 on a feed without a calibration, recording; returns the result and what was opened."""
    monkeypatch.chdir(tmp_path)

    def live(*words, rows=3, error=None):
        feed, opened = Feed(), []

        class Watch:
            def __init__(self, arm, payload, recorder, every_s, *, effort):
                opened.append((arm.name, payload, every_s))

            def moments(self, cycles, going):
                assert going()
                if error is not None:
                    raise error
                yield from ()

        def recorder_of(arm, path, load):
            opened.append((str(path), load and str(load)))
            return Kept(rows)

        for kind in ("rtde_feed", "ros2_feed", "bus_feed"):

            def open_feed(*given, kind=kind):
                opened.append((kind, *map(str, given[1:])))
                return feed

            monkeypatch.setattr(f"armload_controller.session.joint_feeds.{kind}", open_feed)
        monkeypatch.setattr("armload_controller.session.bus_watch.BusWatch", Watch)
        monkeypatch.setattr("armload_controller.session.bus_watch.recorder_of", recorder_of)
        return armload("watch", "er50", "--record", "b.mcap", *words, columns=300), opened

    return live


@pytest.mark.parametrize(
    ("words", "source"),
    [
        (("--rtde", "robot"), ("rtde_feed", "robot")),
        (("--ros2", "/joints"), ("ros2_feed", "/joints", "torque")),
        (("--ros2", "/joints", "--effort", "current"), ("ros2_feed", "/joints", "current")),
        (("--bus", "socketcan:can7"), ("bus_feed",)),
    ],
)
@pytest.mark.parametrize(("rows", "end"), [(3, "written: b.mcap, 3 cycles"), (0, "nothing was recorded")])
def test_an_arm_without_a_calibration_is_recorded_from_its_source(live, words, source, rows, end):
    result, opened = live(*words, rows=rows)
    assert result.exit_code == 0, (result.output, result.exception)
    assert opened == [source, ("b.mcap", None), ("er50", None, 1.0)]
    assert "listening to er50 on can7; positions are sent. Ctrl-C ends it\n" in result.output
    assert result.output.endswith(f"{end}\n")


@pytest.mark.parametrize("rows", [3, 0])
def test_what_was_recorded_until_an_error_is_named(live, rows):
    result, opened = live("--rtde", "robot", "--load", "loaded", rows=rows, error=BusError("the link is lost"))
    assert str(result.exception) == "the link is lost"
    assert ("b.mcap", "loaded") in opened
    told = "recorded up to the error: b.partial.mcap, 3 cycles, usable as it is" in result.output
    assert told is bool(rows)


class Diary:
    """A diary with some moments."""

    def __init__(self, empty=False):
        self.empty, self.moments, self.written = empty, [], []

    def add(self, moment):
        self.moments.append(moment)

    def write(self, path):
        self.written.append(path)


def moments(*problem):
    """A moment, and perhaps an error after it."""
    yield WatchedMoment(*[None] * len(WatchedMoment.__dataclass_fields__))
    for error in problem:
        raise error


@pytest.mark.parametrize(
    ("problem", "empty", "written", "text"),
    [
        ((), False, True, "written: r.html"),
        ((KeyboardInterrupt(),), False, True, "stopped watching\nwritten: r.html"),
        ((BusError("lost"),), False, True, "written: r.html, up to the error"),
        ((BusError("lost"),), True, False, ""),
    ],
)
def test_the_report_is_written_at_the_end_however_it_comes(monkeypatch, capsys, problem, empty, written, text):
    monkeypatch.setattr(
        "armload_controller.cli.output.watch_output.shown_moments", lambda *_given: nullcontext(lambda moment: None)
    )
    diary, arm = Diary(empty), SimpleNamespace(name="er50", joint_names=())
    with pytest.raises(BusError) if problem and isinstance(problem[0], BusError) else nullcontext():
        _show(Screen(), arm, moments(*problem), diary, Path("r.html"))
    assert len(diary.moments) == 1
    assert bool(diary.written) is written
    assert capsys.readouterr().out.strip() == text
    _show(Screen(), arm, moments(), None, None)
