"""What the operator sees while something runs: steps, progress bars, tables, prompts.

A bar is drawn only when a whole percent has been added, by the thread that reports the progress, which may be the
cycle's: a drawing thread of its own would take the cycle's time at random. While the terminal accepts no output
(Ctrl-S, a remote connection that stalls) nothing is drawn, as the cycle would wait for it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import TextIO

from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Column, Table
from rich.text import Text

from armload_controller.cli.console_text import fitted
from armload_controller.cli.keyboard import HINT, Keyboard
from armload_controller.cli.printable_console import PrintableConsole, accepts_output
from armload_controller.cli.printable_text import printable
from armload_controller.control_errors import CommissioningError

UNBOUNDED_WIDTH = 1000
"""Width of what is no terminal."""
_USUAL_WIDTH = 80
"""Width of a terminal that does not know its own."""
_LEAST_BAR = 8
_GREATEST_BAR = 30
_TIME = Column(no_wrap=True, min_width=7)
"""Hours, minutes and seconds."""


class _Rate(ProgressColumn):
    """How much is done per second."""

    def render(self, task: Task) -> Text:
        """The rate since the beginning."""
        return Text("" if not task.elapsed else f"{task.completed / task.elapsed:.1f}/s")


class Screen:
    """A console that satisfies `run_session.Display`.

    Args:
        keyboard: Whose keys are listened to while something is tracked.
        as_json: The result is a document on the standard output: steps, bars and questions go to standard error, and
            results in words are left out.
    """

    def __init__(self, keyboard: Keyboard | None = None, *, as_json: bool = False) -> None:
        self._as_json = as_json
        self._keyboard = keyboard
        self._hinted = False
        self.console = PrintableConsole(stderr=as_json, width=_width(sys.stderr if as_json else sys.stdout))
        self.errors = PrintableConsole(stderr=True, width=_width(sys.stderr))

    def step(self, text: str) -> None:
        """One line: something begins."""
        self.console.print(text, soft_wrap=not self.console.is_terminal)

    def result(self, text: str) -> None:
        """A result in words."""
        if not self._as_json:
            self.step(text)

    def table(self, table: Table) -> None:
        """A result as a table, whole whatever the width."""
        if self._as_json:
            return
        for part in fitted(table, self.console):
            self.console.print(part)

    @contextmanager
    def track(self, text: str, total: int, *, rate: bool = False) -> Iterator[Callable[[int], None]]:
        """A progress bar, with how much is done per second if wanted; the function given takes how much is done."""
        if self._keyboard is not None and not self._hinted:
            self._hinted = True
            self.step(HINT)
        text = printable(text)
        columns = [*self._columns(text), *([_Rate()] if rate else [])]
        bar = Progress(*columns, console=self.console, auto_refresh=False)
        with nullcontext() if self._keyboard is None else self._keyboard.awake(), bar:
            task = bar.add_task(text, total=total)
            drawn, asked = 0, ""

            def done(count: int) -> None:
                nonlocal drawn, asked
                now = "" if self._keyboard is None else self._keyboard.poll()
                new = count - drawn >= total / 100 or count >= total or now != asked
                if new and accepts_output(self.console.file):
                    drawn, asked = count, now
                    bar.update(task, completed=count, refresh=True, description=f"{text}, {now}" if now else text)

            yield done

    def _columns(self, text: str) -> list[ProgressColumn]:
        """What a line of progress is made of; where it is narrow the bar gives way first."""
        times = [TimeElapsedColumn(table_column=_TIME), TimeRemainingColumn(table_column=_TIME)]
        room = self.console.width - len(f"{text}  100% 0:00:00 0:00:00")
        bar = [BarColumn(bar_width=min(room, _GREATEST_BAR))] if room >= _LEAST_BAR else []
        return [
            TextColumn("{task.description}", markup=False, table_column=Column()),
            *bar,
            TaskProgressColumn(),
            *times,
        ]

    def ask(self, question: str) -> str:
        """Ask for a text.

        Raises:
            CommissioningError: there are no more answers.
        """
        try:
            return self.console.input(question, markup=False)
        except EOFError as error:
            self.step("")
            raise CommissioningError("end of input: nothing was done") from error

    def confirm(self, question: str) -> bool:
        """Ask; no answer, as without a keyboard, is no."""
        if self._keyboard is not None:
            self._keyboard.forget()
        try:
            answer = self.ask(f"{question} [y/N] ")
        except CommissioningError:
            return False
        return answer.strip().lower() in {"y", "yes"}


def _width(stream: TextIO | None) -> int:
    """Columns of a stream: what COLUMNS says, else the terminal's; in a file or a pipe lines are as long as they are.

    COLUMNS=0, as some shells and consoles without a size have it, says nothing.
    """
    said = os.environ.get("COLUMNS", "")
    if said.isdecimal() and int(said) > 0:
        return int(said)
    if stream is None or not stream.isatty():
        return UNBOUNDED_WIDTH
    try:
        return os.get_terminal_size(stream.fileno()).columns or _USUAL_WIDTH
    except OSError:
        return _USUAL_WIDTH
