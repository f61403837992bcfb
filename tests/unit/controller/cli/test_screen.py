"""The operator's screen without a terminal: widths, questions, and how often a line of progress is drawn."""

import os
from types import SimpleNamespace

import pytest

from armload_controller.cli import screen as module
from armload_controller.cli.screen import Screen, _columns, _width
from armload_controller.control_errors import CommissioningError


class Stream:
    def __init__(self, terminal):
        self.terminal = terminal

    def isatty(self):
        return self.terminal

    def fileno(self):
        return 7


@pytest.mark.parametrize(
    ("said", "terminal", "size", "width"),
    [
        ("120", True, 90, 120), ("0", True, 90, 90), ("", True, 90, 90), ("wide", True, 90, 90), ("1", False, 90, 1),
        ("", True, 0, 80), ("", True, OSError(), 80), ("", False, 90, 1000), ("", None, 90, 1000),
    ],
)  # fmt: skip
def test_the_width_is_that_of_columns_or_of_the_terminal_and_a_file_has_none(monkeypatch, said, terminal, size, width):
    def size_of(descriptor):
        assert descriptor == 7
        if isinstance(size, OSError):
            raise size
        return SimpleNamespace(columns=size)

    monkeypatch.setenv("COLUMNS", said)
    monkeypatch.setattr(os, "get_terminal_size", size_of)
    assert _width(None if terminal is None else Stream(terminal)) == width


class Console:
    """Answers questions, and notes what is printed."""

    width, is_terminal, file = 100, False, None

    def __init__(self, *answers):
        self.answers, self.asked, self.printed = list(answers), [], []

    def input(self, question, *, markup):
        assert markup is False
        self.asked.append(question)
        if not self.answers:
            raise EOFError
        return self.answers.pop(0)

    def print(self, text, **options):
        self.printed.append((text, options))


def with_console(*answers, as_json=False):
    screen = Screen(as_json)
    screen.console = Console(*answers)
    return screen


@pytest.mark.parametrize(
    ("answer", "agreed"), [("y", True), (" Yes ", True), ("Y", True), ("", False), ("n", False), ("yep", False)]
)
def test_only_yes_is_a_yes(answer, agreed):
    screen = with_console(answer)
    assert screen.confirm("Go on?") is agreed
    assert screen.console.asked == ["Go on? [y/N] "]


def test_the_end_of_the_input_is_a_no_and_an_error_of_a_text():
    screen = with_console()
    assert screen.confirm("Go on?") is False
    with pytest.raises(CommissioningError, match="end of input: nothing was done"):
        screen.ask("Name?")


def test_what_was_typed_before_a_question_is_forgotten():
    screen = with_console("y")
    order = []
    screen.keyboard = SimpleNamespace(forget=lambda: order.append(len(screen.console.asked)))
    assert screen.confirm("Go on?")
    assert order == [0]


def test_results_as_text_are_left_out_of_a_document_and_steps_are_not(tmp_path):
    for as_json, printed in ((False, ["a", "b", "warning: c"]), (True, ["b", "warning: c"])):
        screen = with_console(as_json=as_json)
        screen.result("a")
        screen.step("b")
        screen.remarks("warning", ["c"])
        assert [text for text, _ in screen.console.printed] == printed
        assert all(options == {"soft_wrap": True} for _, options in screen.console.printed)
    written = []
    screen.write(written.append, None)
    screen.write(written.append, tmp_path / "x")
    assert written == [tmp_path / "x"]
    assert screen.console.printed[-1][0] == f"written: {tmp_path / 'x'}"


@pytest.mark.parametrize(("width", "bar"), [(31, None), (32, 8), (40, 16), (54, 30), (90, 30)])
def test_a_bar_has_what_text_percent_and_times_leave_from_8_to_30(width, bar):
    """The text "ab", two spaces, "100%", and two times of seven characters with a space before each: 24."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    for rate in (False, True):
        text, *others = _columns("ab", width, rate=rate)
        assert type(text) is TextColumn
        if bar is not None:
            assert type(others[0]) is BarColumn
            assert others.pop(0).bar_width == bar
        assert [type(each) for each in others[:3]] == [TaskProgressColumn, TimeElapsedColumn, TimeRemainingColumn]
        assert len(others) == 3 + rate
    rated = others[-1]
    assert str(rated.render(SimpleNamespace(elapsed=4.0, completed=10.0))) == "2.5/s"
    assert str(rated.render(SimpleNamespace(elapsed=0.0, completed=10.0))) == ""


class Bar:
    """A progress line that notes when it is drawn."""

    drawn = None

    def __init__(self, *columns, console, auto_refresh):
        assert not auto_refresh

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def add_task(self, text, total):
        assert (text, total) == ("round", 1000)

    def update(self, task, *, completed, refresh, description):
        assert refresh
        Bar.drawn.append((completed, description))


def test_a_line_of_progress_is_drawn_at_every_percent_and_at_its_end(monkeypatch):
    import rich.progress

    from armload_controller.cli import printable_console

    monkeypatch.setattr(rich.progress, "Progress", Bar)
    accepts = [True]
    monkeypatch.setattr(printable_console, "accepts_output", lambda file: accepts[0])
    Bar.drawn, screen = [], with_console()
    with screen.track("round", 1000) as done:
        for count in (9, 10, 19, 20, 999, 1000):
            done(count)
        accepts[0] = False
        done(1000)
    assert Bar.drawn == [(count, "round") for count in (10, 20, 999, 1000)], "and not while nothing can be shown"
    assert screen.console.printed == []


def test_keys_are_polled_while_something_is_tracked_and_their_hint_is_shown_once(monkeypatch):
    import contextlib

    import rich.progress

    from armload_controller.cli import printable_console

    monkeypatch.setattr(rich.progress, "Progress", Bar)
    monkeypatch.setattr(printable_console, "accepts_output", lambda file: True)
    states = iter(["", "paused", "paused", ""])
    screen = with_console()
    screen.keyboard = SimpleNamespace(poll=lambda: next(states), awake=contextlib.nullcontext)
    Bar.drawn = []
    for _ in range(2):
        with screen.track("round", 1000) as done:
            done(1)
            done(2)
    assert Bar.drawn == [(2, "round, paused"), (1, "round, paused"), (2, "round")]
    assert [text for text, _ in screen.console.printed] == [module.HINT]
