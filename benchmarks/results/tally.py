"""Prints criteria with their figures and whether they are met, and counts them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn


class Tally:
    """Prints headings and criteria; the program's exit status follows from its count."""

    def __init__(self) -> None:
        self.met = 0
        self.not_met: list[str] = []
        self.not_yet = 0
        self._begun_s = perf_counter()

    def heading(self, text: str) -> None:
        """Print the heading of a new part."""
        title = f"{text} (after {perf_counter() - self._begun_s:.0f} s)"
        print(f"\n{title}\n{'=' * len(title)}", flush=True)

    def judge(self, criterion: str, figure: str, met: bool) -> None:
        """Print and count one criterion."""
        if met:
            self.met += 1
        else:
            self.not_met.append(criterion)
        print(f"  > {criterion}: {figure}: {'met' if met else 'NOT met'}", flush=True)

    def postpone(self, criterion: str, reason: str) -> None:
        """Print and count one criterion that cannot be tested yet, or not here."""
        self.not_yet += 1
        print(f"  > {criterion}: not yet, {reason}", flush=True)

    def finish(self) -> int:
        """Print the count; the exit status, 1 if a criterion is not met."""
        seconds = perf_counter() - self._begun_s
        print(f"\n{self.met} met, {len(self.not_met)} not met, {self.not_yet} not yet; {seconds:.0f} s")
        for criterion in self.not_met:
            print(f"  NOT met: {criterion}")
        return 1 if self.not_met else 0


@contextmanager
def progress_line(text: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on the terminal, removed at the end; a log gets only the text."""
    console = Console(stderr=True)
    if not console.is_terminal:
        console.print(f"... {text}: {total}", highlight=False)
        yield lambda done: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
