"""A console on which no text from a file can do more than be read."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EIO, EPIPE
from typing import IO, Any, TextIO, cast

from rich.console import Console
from rich.text import Text

from armload_controller.cli.printable_text import printable


class OutlivingStream:
    """A stream whose reader may go: what is written after that is dropped, and the program goes on.

    An arm in motion is not left to itself because the terminal was closed, or the pipe that it is shown through.

    Args:
        stream: The stream.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or drop."""
        with self._dropping():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush, or drop."""
        with self._dropping():
            self._stream.flush()

    @contextmanager
    def _dropping(self) -> Iterator[None]:
        """Where the reader has gone, what is still in the stream's buffer goes nowhere too."""
        try:
            yield
        except OSError as error:
            if error.errno not in (EIO, EPIPE):
                raise
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


def accepts_output(stream: IO[str]) -> bool:
    """Whether a line can be written to a stream at once; True for what is no file.

    A terminal that is halted (Ctrl-S), or whose remote reader has stalled, lets a writer wait.
    """
    try:
        return bool(select.select([], [stream.fileno()], [], 0.0)[1])
    except (OSError, ValueError):
        return True


class PrintableConsole(Console):
    """Rich's console; every string that it is given is made printable first, and none of it is markup or an emoji.

    Args:
        file: Where to print; standard output, or standard error, if not given.
        stderr: Print to standard error.
        **options: As Rich has them.
    """

    def __init__(self, *, file: TextIO | None = None, stderr: bool = False, **options: Any) -> None:
        stream = file or (sys.stderr if stderr else sys.stdout)
        # A stream that was closed when the program started is None; Rich drops what is printed to it.
        outliving = None if stream is None else cast(TextIO, OutlivingStream(stream))
        super().__init__(markup=False, emoji=False, highlight=False, file=outliving, stderr=stderr, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`.

        Args:
            text: The string.
            **options: As Rich has them.
        """
        return super().render_str(printable(text), **options)
