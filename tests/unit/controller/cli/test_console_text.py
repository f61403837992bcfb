"""Output on a narrow console, in a file and on a terminal without colours: every word and every number."""

import io
import os
import re
import select
import subprocess
import sys
import termios
import threading

import numpy as np
import pytest
from rich.console import Console
from rich.table import Column, Table
from typer.testing import CliRunner

from armload_controller.cli.command_tree import app
from armload_controller.cli.console_text import drawn, fitted
from armload_controller.cli.output.result_tables import payload_table
from armload_controller.cli.screen import Screen
from armload_drivers.bring_up import arm_bring_up
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance

WIDTHS = [40, 60, 80, 200]
BODY = InertialParameters.from_center_of_mass(
    12.3456, [0.0123, -0.1234, 0.0987], [[0.31, 0.04, -0.02], [0.04, 0.22, 0.03], [-0.02, 0.03, 0.17]]
)


def payload():
    half = np.abs(BODY.values) * 0.01
    interval = np.stack([BODY.values - half, BODY.values + half], axis=1)
    noise = np.ones(6)
    return PayloadResult("flange", BODY, np.arange(10) != 4, interval, noise, noise, Provenance("0", "0", {}))


def prose():
    table = Table(title="bring-up short of enabling")
    for heading in ("joint", "step", "", "what"):
        table.add_column(heading, overflow="fold")
    text = "6065 (the drive does not stop when it cannot follow); make sure by other means that the arm stops"
    table.add_row("prbt_joint_1", "checking the safety properties", "[red]missing[/]", text)
    table.add_row("prbt_joint_2", "answers", "[green]ok[/]", "")
    return table


def shown(table, width):
    """The text printed in a width, and its parts."""
    stream = io.StringIO()
    console = Console(file=stream, width=width, highlight=False, color_system=None)
    parts = fitted(table, console)
    for part in parts:
        console.print(part)
    return stream.getvalue(), parts


def texts(table):
    """The texts of a table, without markup."""
    found = [table.title or "", *(str(column.header) for column in table.columns)]
    found += [str(cell) for column in table.columns for cell in column.cells]
    return [re.sub(r"\[/?\w*\]", "", text) for text in found]


def test_spare_width_goes_where_it_saves_lines():
    table = Table("joint", "the drive ...", "by")
    table.add_row("1", "word " * 8, "word " * 23)
    printed, _ = shown(table, 100)
    assert len(printed.splitlines()) == 3 + 2 + 1


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    "make", [lambda: drawn(payload_table(payload(), BODY)), lambda: drawn(payload_table(payload(), None)), prose]
)
def test_no_word_is_broken_and_no_number_lost(make, width):
    output, _ = shown(make(), width)
    assert max(map(len, output.splitlines())) <= width
    assert "…" not in output
    words = set(re.split(r"[\s│┃]+", output))
    for text in texts(make()):
        assert set(text.split()) <= words, text


@pytest.mark.parametrize("width", WIDTHS)
def test_numbers_stay_in_one_piece_and_rows_are_distinguished(width):
    table = drawn(payload_table(payload(), BODY))
    output, parts = shown(table, width)
    intervals = [cell for cell in table.columns[2].cells if cell]
    assert all(interval in output for interval in intervals)
    assert all(part.columns[0].header == "parameter" for part in parts)
    assert (len(parts) > 1) == (width < 80)
    assert len([line for line in output.splitlines() if "mass " in line and "│" in line]) == len(parts)


def test_the_truth_is_counted_beside_what_is_expected():
    """Nine of ten are determined; the mass is given outside its interval."""
    heavier = InertialParameters.from_center_of_mass(BODY.mass_kg * 1.02, BODY.center_of_mass_m, BODY.inertia_about_com)
    for truth, held in ((BODY, 9), (heavier, 8)):
        said = f"true values in their intervals: {held} of 9; expected on average: 8.5"
        assert payload_table(payload(), truth).sentences == (said,)
    assert payload_table(payload(), None).sentences == ()


def test_a_table_with_room_is_left_as_it_is():
    table = prose()
    assert shown(table, 300)[1] == [table]


@pytest.mark.parametrize("command", [[], ["commission"], ["identify"], ["export"], ["feedforward", "run"]])
def test_help_shows_every_option_by_its_whole_name(command):
    narrow, wide = (CliRunner().invoke(app, [*command, "--help"], terminal_width=width).output for width in (60, 200))
    assert "…" not in narrow
    assert max(map(len, narrow.splitlines())) <= 60
    options = set(re.findall(r"^ +(?:-\w, )?(--[\w-]+)", wide, re.MULTILINE))
    assert options
    assert options == set(re.findall(r"^ +(?:-\w, )?(--[\w-]+)", narrow, re.MULTILINE))


def test_a_rows_name_stays_in_one_piece():
    table = Table("joint", "what")
    table.add_row("joint_2 *", "a text that has to be wrapped where there is as little room as here")
    assert "joint_2 *" in shown(table, 30)[0]


def test_a_long_line_of_progress_wraps_and_keeps_its_times():
    screen, stream = Screen(), io.StringIO()
    screen.console = Console(file=stream, width=60, force_terminal=True, color_system=None)
    with screen.track("loaded, without feed-forward, slow round", 1) as done:
        done(1)
    output = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\n", stream.getvalue())
    assert output.split("100%")[-1].split()[:2] == ["0:00:00", "0:00:00"]
    assert "…" not in output
    assert {"loaded,", "without", "feed-forward,", "slow", "round"} <= set(output.split())


@pytest.mark.parametrize("width", [60, 100])
def test_a_line_of_progress_fits_the_terminal(width):
    screen = Screen()
    stream = io.StringIO()
    screen.console = Console(file=stream, width=width, force_terminal=True, color_system=None)
    with screen.track("loaded: identification, slow round", 100) as done:
        done(50)
        done(100)
    lines = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\n", stream.getvalue()).replace("\r", "\n").splitlines()
    last = [line for line in lines if "100%" in line][-1]
    assert "…" not in last
    assert last.startswith("loaded: identification, slow round ")
    assert last.count("0:00:00") == 2
    assert len(last) <= width


def test_a_terminal_that_accepts_nothing_does_not_halt_what_reports_its_progress():
    """Ctrl-S or a stalled remote connection while the cycle draws the bar."""
    reader, terminal = os.openpty()
    screen = Screen()
    with os.fdopen(reader, "rb", 0) as shown_bytes, os.fdopen(terminal, "w") as stream:
        screen.console = Console(file=stream, width=60, force_terminal=True, color_system=None)
        with screen.track("loaded: identification", 100) as done:

            def go_on():
                for count in range(11, 91):
                    done(count)

            done(10)
            termios.tcflow(terminal, termios.TCOOFF)
            cycle = threading.Thread(target=go_on, daemon=True)
            cycle.start()
            cycle.join(10.0)
            halted = cycle.is_alive()
            termios.tcflow(terminal, termios.TCOON)
            done(91)
        output = ""
        while " 91%" not in output and select.select([reader], [], [], 10.0)[0]:  # the kernel passes it on later
            output += shown_bytes.read(100_000).decode()
    assert not halted
    assert " 10%" in output
    assert " 50%" not in output
    assert " 91%" in output


NOTED = """
import sys
from armload_controller.cli import command_tree
from armload_controller.control_errors import MotionError
from armload_drivers.driver_errors import BusError

def fail():
    cause = BusError("no frame leaves")
    cause.add_note("At the same time: joint_5 is in FAULT")
    error = MotionError("Motion stopped", ())
    error.add_note("A drive may still carry torque: use the emergency stop.")
    raise error from cause

command_tree.app = fail
from armload_controller.cli.entry import main
main()
"""


def test_what_was_noted_with_an_error_reaches_the_operator():
    done = subprocess.run([sys.executable, "-c", NOTED], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "error: Motion stopped",
        "A drive may still carry torque: use the emergency stop.",
        "At the same time: joint_5 is in FAULT",
    ]


ON_TOP = """
from armload_controller.cli import command_tree
from armload_drivers.driver_errors import BusError, StateError

def fail():
    try:
        raise BusError("bus-off while moving")
    finally:
        raise StateError("closing failed as well")

command_tree.app = fail
from armload_controller.cli.entry import main
main()
"""


def test_an_error_on_top_of_another_does_not_hide_it():
    done = subprocess.run([sys.executable, "-c", ON_TOP], capture_output=True, text=True, check=False)
    assert done.stderr.splitlines() == ["error: closing failed as well", "Before that: bus-off while moving"]


@pytest.mark.parametrize("environment", [{}, {"NO_COLOR": "1"}, {"COLUMNS": "60"}])
def test_a_file_gets_no_colours_and_whole_tables(environment, monkeypatch):
    monkeypatch.setattr(arm_bring_up, "LISTEN_S", 0.01)
    done = CliRunner().invoke(app, ["drives", "show", "prbt", "--once"], env={"COLUMNS": None} | environment)
    assert done.exit_code == 0, done.output
    assert "\x1b" not in done.output
    assert "…" not in done.output
    whole = [line for line in done.output.splitlines() if "prbt_joint_6" in line and "SWITCH ON DISABLED" in line]
    assert len(whole) == (environment.get("COLUMNS") is None)


def test_a_table_without_rows_is_as_wide_as_its_headings():
    """Each column has two spaces and a line, and the table one more."""
    table = Table("a heading", Column("right one", justify="right"))
    needed = 9 + 3 + 9 + 3 + 1
    assert shown(table, needed)[1] == [table]
    narrower = shown(table, needed - 1)
    assert narrower[1] != [table]
    assert max(map(len, narrower[0].splitlines())) <= needed - 1


def test_a_table_is_split_where_its_least_widths_do_not_fit():
    """Words of 10, 10 and 10 letters need 13 each, and 1: two columns fit 27, three 40."""
    table = Table(*(letter * 10 for letter in "abc"), title="t")
    table.add_row(*("x" * 10 for _ in range(3)))
    for width, columns in ((40, [3]), (39, [2, 2]), (27, [2, 2])):
        _, parts = shown(table, width)
        assert [len(part.columns) for part in parts] == columns
        assert [part.title for part in parts] == ["t", None][: len(parts)]
