"""What the operator sees while something runs: steps, progress bars, tables, prompts.

A bar is drawn only when a whole percent has been added, by the thread that reports the progress: a drawing
thread of its own would take the cycle's time at random.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class Screen:
    """A console that satisfies `commissioning.Watcher`."""

    def __init__(self) -> None:
        self.console = Console(highlight=False)
        self.errors = Console(stderr=True, highlight=False)

    def step(self, text: str) -> None:
        """One line: something begins."""
        self.console.print(text, markup=False)

    @contextmanager
    def track(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """A progress bar; the function given takes how much is done."""
        bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=30),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self.console,
            auto_refresh=False,
        )
        with bar:
            task = bar.add_task(text, total=total)
            drawn = 0

            def done(count: int) -> None:
                nonlocal drawn
                if count - drawn >= total / 100 or count >= total:
                    drawn = count
                    bar.update(task, completed=count, refresh=True)

            yield done

    def confirm(self, question: str) -> bool:
        """Ask; no answer, as without a keyboard, is no."""
        try:
            answer = self.console.input(f"{question} [y/N] ", markup=False)
        except EOFError:
            self.step("")
            return False
        return answer.strip().lower() in {"y", "yes"}


class StopRequest:
    """Ctrl-C and SIGTERM as a question that the cycle asks; a second one interrupts at once."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """Whether a stop was asked for."""
        return self._asked

    @contextmanager
    def listening(self) -> Iterator[StopRequest]:
        """Take the signals over for a while."""
        before = {number: signal.signal(number, self._on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield self
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True
