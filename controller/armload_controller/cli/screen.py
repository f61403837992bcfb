"""The operator's screen: steps, progress bars, tables, prompts.

A bar is redrawn only after a full percent, by the thread that reports the progress, which may be the cycle's: a
separate drawing thread would disturb the cycle at random. While the terminal accepts no output (Ctrl-S, a stalled
remote connection) nothing is drawn, because the cycle would wait for it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from armload_controller.cli.keyboard import HINT, Keyboard
from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.control_errors import CommissioningError
from armload_identification.storage.control_characters import printable

if TYPE_CHECKING:
    from rich.progress import ProgressColumn, Task
    from rich.table import Table
    from rich.text import Text

    from armload_controller.cli.printable_console import PrintableConsole
    from armload_identification.result_table import ResultTable

UNBOUNDED_WIDTH = 1000
"""Width of a stream that is not a terminal."""
_USUAL_WIDTH = 80
"""Width of a terminal that does not report one."""
_LEAST_BAR_WIDTH = 8
_GREATEST_BAR_WIDTH = 30
_TIME_WIDTH = 7
"""Hours, minutes and seconds."""


@dataclass(eq=False)
class Screen:
    """A console that satisfies `run_session.Display`; a parameter of each command, with the option `--json`.

    Attributes:
        as_json: The result is a document on standard output: steps, bars and questions go to standard error, and
            results as text are omitted.
        keyboard: Keyboard that is polled while something is tracked.
    """

    as_json: JsonOption = False
    keyboard: Keyboard | None = field(default=None, init=False)
    _hint_shown: bool = field(default=False, init=False)

    @cached_property
    def console(self) -> PrintableConsole:
        """Where results go; rich is loaded when something is printed."""
        from armload_controller.cli.printable_console import PrintableConsole

        return PrintableConsole(stderr=self.as_json, width=_width(sys.stderr if self.as_json else sys.stdout))

    def step(self, text: str) -> None:
        """Print one line, for the start of an activity."""
        self.console.print(text, soft_wrap=not self.console.is_terminal)

    def remarks(self, kind: str, texts: Iterable[str]) -> None:
        """Print remarks of a kind, such as warnings, one line each."""
        for text in texts:
            self.step(f"{kind}: {text}")

    def result(self, *texts: str) -> None:
        """Print a result as text, one line each."""
        if not self.as_json:
            for text in texts:
                self.step(text)

    def table(self, table: Table) -> None:
        """Print a result as a table, complete at any width."""
        from armload_controller.cli.console_text import fitted

        if self.as_json:
            return
        for part in fitted(table, self.console):
            self.console.print(part)

    def result_table(self, result: ResultTable) -> None:
        """Print a result's own table, and the sentences below it."""
        from armload_controller.cli.console_text import drawn

        self.table(drawn(result))
        self.result(*result.sentences)

    def write(self, write: Callable[[Path], object], file: Path | None) -> None:
        """Write a result's file, if one is requested.

        Raises:
            OSError: the file cannot be written.
        """
        if file is not None:
            write(file)
            self.step(f"written: {file}")

    def document(self, make: Callable[[], dict[str, Any]], files: Mapping[str, Path | None] | None = None) -> None:
        """Print a result as a document, if one is wanted.

        Args:
            make: Makes the document, without its files.
            files: Files that were written, by their key in the document; None for one that was not requested.
        """
        if not self.as_json:
            return
        paths = {key: None if path is None else str(path) for key, path in (files or {}).items()}
        print_document(make() | ({} if files is None else {"files": paths}))

    @contextmanager
    def track(self, text: str, total: int, *, rate: bool = False) -> Iterator[Callable[[int], None]]:
        """Show a progress bar, optionally with a rate; the yielded function is called with the amount done."""
        from rich.progress import Progress

        from armload_controller.cli.printable_console import accepts_output

        if self.keyboard is not None and not self._hint_shown:
            self._hint_shown = True
            self.step(HINT)
        text = printable(text)
        bar = Progress(*_columns(text, self.console.width, rate=rate), console=self.console, auto_refresh=False)
        with nullcontext() if self.keyboard is None else self.keyboard.awake(), bar:
            task = bar.add_task(text, total=total)
            drawn, asked = 0, ""

            def done(count: int) -> None:
                nonlocal drawn, asked
                now = "" if self.keyboard is None else self.keyboard.poll()
                new = count - drawn >= total / 100 or count >= total or now != asked
                if new and accepts_output(self.console.file):
                    drawn, asked = count, now
                    bar.update(task, completed=count, refresh=True, description=f"{text}, {now}" if now else text)

            yield done

    def ask(self, question: str) -> str:
        """Ask for a text.

        Raises:
            CommissioningError: the input has ended.
        """
        try:
            return self.console.input(question, markup=False)
        except EOFError as error:
            self.step("")
            raise CommissioningError("end of input: nothing was done") from error

    def confirm(self, question: str) -> bool:
        """Ask a yes/no question; no answer, as at the end of input, means no."""
        if self.keyboard is not None:
            self.keyboard.forget()
        try:
            answer = self.ask(f"{question} [y/N] ")
        except CommissioningError:
            return False
        return answer.strip().lower() in {"y", "yes"}


PLAIN = Screen()
"""The default of a command's parameter, which is replaced: it may then follow optional ones."""


def _columns(text: str, width: int, *, rate: bool) -> list[ProgressColumn]:
    """Columns of a progress line, which may end with the amount done per second; if narrow, without a bar."""
    from rich.progress import (
        BarColumn,
        ProgressColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column
    from rich.text import Text

    class Rate(ProgressColumn):
        """Amount done per second since the start."""

        def render(self, task: Task) -> Text:
            return Text("" if not task.elapsed else f"{task.completed / task.elapsed:.1f}/s")

    time = Column(no_wrap=True, min_width=_TIME_WIDTH)
    room = width - len(f"{text}  100% 0:00:00 0:00:00")
    bar = [BarColumn(bar_width=min(room, _GREATEST_BAR_WIDTH))] if room >= _LEAST_BAR_WIDTH else []
    text_column = TextColumn("{task.description}", markup=False, table_column=Column())
    times = [TimeElapsedColumn(table_column=time), TimeRemainingColumn(table_column=time)]
    return [text_column, *bar, TaskProgressColumn(), *times, *([Rate()] if rate else [])]


def _width(stream: TextIO | None) -> int:
    """Columns of a stream: COLUMNS if set, else the terminal's; lines in a file or pipe are not wrapped.

    COLUMNS=0, which some shells and consoles without a size set, is ignored.
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
