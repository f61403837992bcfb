"""No text from a file moves the cursor, changes colours or is taken for markup."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.table import Table

from armload_controller.cli.output.json_output import print_document
from armload_controller.cli.printable_console import PrintableConsole
from armload_controller.cli.screen import Screen
from armload_identification.storage.control_characters import printable

HOSTILE = "joint\x1b[2J\x9b31m\x07\r\x00 [red]ä[/] \u202eexe\udc80\t|"
READABLE = r"joint\u001b[2J\u009b31m\u0007\u000d\u0000 [red]ä[/] \u202eexe\udc80" + "\t|"


def test_control_characters_are_written_out():
    assert printable(HOSTILE) == READABLE
    assert printable("two\nlines") == "two\nlines"


def test_steps_errors_tables_and_bars_are_printable(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    screen = Screen()
    screen.step(HOSTILE)
    Screen(as_json=True).console.print(HOSTILE, style="bold red", soft_wrap=True)
    table = Table(title=HOSTILE.replace("\t", ""))
    table.add_column(HOSTILE.replace("\t", ""))
    table.add_row(HOSTILE.replace("\t", ""))
    screen.table(table)
    with screen.track(HOSTILE.replace("\t", ""), 1) as done:
        done(1)
    shown = capsys.readouterr()
    for text, times in ((shown.out, 5), (shown.err, 1)):
        assert text.count(r"joint\u001b[2J\u009b31m\u0007\u000d\u0000 [red]ä[/] \u202eexe\udc80") == times
        assert not set(text) & set("\x1b\x9b\x07\x00\u202e\udc80")


def test_text_stays_as_it_is(capsys):
    Screen().step("root:x:0 [b]:warning:")
    assert capsys.readouterr().out == "root:x:0 [b]:warning:\n"


def test_a_terminal_gets_the_programs_own_colours_only():
    shown = io.StringIO()
    PrintableConsole(file=shown, force_terminal=True, width=200).print("a\x1b[5mb", style="red")
    assert r"a\u001b[5mb" in shown.getvalue()
    assert "\x1b[5m" not in shown.getvalue()
    assert "\x1b[31m" in shown.getvalue()


def test_a_document_says_the_same_without_control_characters(capsys):
    print_document({"name": HOSTILE, "path": "\\\x9b"})
    text = capsys.readouterr().out
    assert json.loads(text) == {"name": HOSTILE, "path": "\\\x9b"}
    assert not set(text) & set("\x1b\x9b\x7f\u202e")


def test_a_pipe_whose_reader_has_gone_is_written_to_no_more():
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as shown:
        console = PrintableConsole(file=shown)
        console.print("heard")
        os.close(reading)
        for _ in range(3):
            console.print("x" * 100_000)
    assert shown.closed, "what was left in its buffer went nowhere as well"


def test_a_full_disk_is_not_taken_for_a_reader_that_has_gone(tmp_path):
    """The program goes on, as an arm may move, and ends with an error in one line; it ended with a traceback."""
    path = tmp_path / "log.csv"
    path.write_text("t,q1,q2,tau1,tau2\n" + "\n".join(f"{0.01 * k},0.{k},1,2,3" for k in range(30)))
    program = Path(sys.executable).with_name("armload")
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [program, "recordings", "show", path], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert ended.returncode == 1
    assert ended.stderr == "error: the output could not be written: No space left on device\n"


@pytest.mark.parametrize(("columns", "width"), [("0", 1000), ("", 1000), ("no", 1000), ("72", 72)])
def test_columns_that_say_nothing_are_no_width(monkeypatch, columns, width):
    monkeypatch.setenv("COLUMNS", columns)
    screen = Screen()
    assert (screen.console.width, Screen(as_json=True).console.width) == (width, width)


def test_errors_are_printed_where_standard_output_is_closed(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", None)
    Screen().step("goes nowhere")
    Screen(as_json=True).console.print("what went wrong")
    assert capsys.readouterr().err == "what went wrong\n"
