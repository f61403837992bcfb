"""How the program ends: one line and a status for its own errors, a traceback for others."""

import gc
import signal
import warnings

import pytest

from armload_controller.cli import command_tree, entry
from armload_controller.cli.printable_console import OutlivingStream
from armload_controller.control_errors import CommissioningError, MotionError
from armload_controller.motion.motion_control import OperatorStop, TerminationStop
from armload_drivers.driver_errors import BusError


@pytest.fixture
def ended(monkeypatch):
    """The status with which the program ends after something is raised."""
    before, form = gc.get_threshold(), warnings.formatwarning

    def ended(problem):
        def app():
            raise problem

        monkeypatch.setattr(command_tree, "app", app)
        with pytest.raises(SystemExit) as caught:
            entry.main()
        return caught.value.code

    yield ended
    gc.set_threshold(*before)
    warnings.formatwarning = form


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("problem", "status", "text"),
    [
        (CommissioningError("no folder"), 1, "error: no folder\n"),
        (BusError("no bus"), 1, "error: no bus\n"),
        (caused(MotionError("stopped", ()), OperatorStop("by hand")), 130, "stopped\n"),
        (caused(MotionError("ended", ()), KeyboardInterrupt()), 130, "ended\n"),
        (caused(MotionError("ended", ()), TerminationStop("bye", signal.SIGHUP)), 129, "ended\n"),
        (ModuleNotFoundError("No module", name="scipy.linalg"), 1, "error: this needs SciPy, which"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (SystemExit(5), 5, ""),
    ],
)
def test_an_error_is_a_line_and_a_status(ended, capsys, problem, status, text):
    assert ended(problem) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(text)
    assert bool(err) is bool(text)


@pytest.mark.parametrize(
    ("code", "problem", "status"), [(0, "disk full", 1), (None, "disk full", 1), (3, "disk full", 3)]
)
def test_output_that_was_lost_is_an_error_unless_there_is_another(ended, monkeypatch, capsys, code, problem, status):
    monkeypatch.setattr(OutlivingStream, "problem", problem)
    assert ended(SystemExit(code)) == status
    assert ("error: the output could not be written: disk full\n" in capsys.readouterr().err) is (status == 1)


def test_a_bug_keeps_its_traceback(ended):
    for problem in (ZeroDivisionError("bug"), ModuleNotFoundError("No module", name="nothing")):
        with pytest.raises(type(problem)):
            ended(problem)


def test_notes_and_what_came_before_are_told_with_an_error(ended, capsys):
    cause, error = ValueError("cause"), CommissioningError("no folder")
    cause.add_note("a step by hand")
    error.add_note("another drive")
    error.__context__ = ValueError("first")
    error.__cause__, error.__suppress_context__ = cause, False
    ended(error)
    assert capsys.readouterr().err.splitlines() == [
        *("error: no folder", "another drive", "a step by hand", "Before that: first")
    ]


def test_every_warning_is_one_line_once():
    line = entry._in_one_line()
    assert [line(UserWarning(text), UserWarning, "file", 1) for text in ("a", "b", "a")] == [
        *("warning: a\n", "warning: b\n", "")
    ]
