"""A console on which text from files cannot have side effects."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EIO, EPIPE
from typing import IO, Any, ClassVar, TextIO, cast

from rich.console import Console
from rich.text import Text

from armload_controller.cli.argument_names import as_options
from armload_identification.storage.control_characters import printable


class OutlivingStream:
    """A stream that survives the loss of its reader, or a full disk: later output is dropped; the program continues.

    A moving arm must not be left uncontrolled because the terminal or a pipe was closed.

    Attributes:
        problem: Why output that somebody wants was lost, such as a full disk; None if none was, or its reader went.
    """

    problem: ClassVar[str | None] = None

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
        """After an error, redirect the stream to the null device, including what is still buffered."""
        try:
            yield
        except OSError as error:
            if error.errno not in (EIO, EPIPE):
                OutlivingStream.problem = error.strerror
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)


def accepts_output(stream: IO[str]) -> bool:
    """Whether a line can be written to a stream without waiting; True if it is not a file.

    A terminal that is halted (Ctrl-S), or whose remote reader has stalled, lets a writer wait.
    """
    try:
        return bool(select.select([], [stream.fileno()], [], 0.0)[1])
    except (OSError, ValueError):
        return True


class PrintableConsole(Console):
    """Rich's console that makes every string printable first, without markup or emoji.

    Args:
        file: Stream to print to; standard output, or standard error, if not given.
        stderr: Print to standard error.
        **options: Rich's options.
    """

    def __init__(self, *, file: TextIO | None = None, stderr: bool = False, **options: Any) -> None:
        stream = file or (sys.stderr if stderr else sys.stdout)
        # A stream that was closed when the program started is None; Rich drops what is printed to it.
        outliving = None if stream is None else cast(TextIO, OutlivingStream(stream))
        super().__init__(markup=False, emoji=False, highlight=False, file=outliving, stderr=stderr, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """See `Console.render_str`."""
        return super().render_str(printable(as_options(text)), **options)
