"""The log of an adapted run's decisions, which neither a halted terminal nor a slow disk can delay."""

from __future__ import annotations

import json
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Self

from armload_controller.control_errors import CommissioningError, RecordingFailed
from armload_controller.cycle.realtime import running_worker
from armload_controller.feedforward.adaptation import AdaptationDecision
from armload_controller.session.run_session import Display
from armload_identification.storage.own_file import require_own


class DecisionLog:
    """Shows every decision and appends it to a file, in a thread of its own; a context manager.

    Decisions are made in the cycle, while the arm moves. If the cycle waited for a terminal that accepts no output
    (Ctrl-S, a stalled remote connection), setpoints would end, and no signal could stop the arm along its path.

    Args:
        path: File of one line of JSON per decision; lines are appended.
        robot: Name of the robot, in every line.
        display: Shows the decisions.

    Raises:
        CommissioningError: the file cannot be written, or has other lines.
    """

    def __init__(self, path: Path, robot: str, display: Display) -> None:
        require_own(path, "decisions", CommissioningError, "--decisions")
        try:
            self._file = path.open("a", encoding="utf-8")
        except OSError as error:
            raise CommissioningError(
                f"{path}: {error.strerror}: choose a --decisions file that can be written"
            ) from error
        self._path, self._robot, self._display = path, robot, display
        self._executor = running_worker("decisions")
        self._last_written: Future[None] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._executor.shutdown(wait=True)
        with suppress(OSError):  # of lines that were not written, which is reported below
            self._file.close()
        if error is None and self._last_written is not None:
            self._last_written.result()

    def report(self, decision: AdaptationDecision) -> None:
        """Hand a decision over; returns at once.

        Raises:
            RecordingFailed: an earlier one could not be written.
        """
        if self._last_written is not None and self._last_written.done():
            self._last_written.result()
        self._last_written = self._executor.submit(self._write_and_show, decision, self._last_written)

    def _write_and_show(self, decision: AdaptationDecision, before: Future[None] | None) -> None:
        """Write and show a decision, unless an earlier one could not be written."""
        if before is not None:
            before.result()
        try:
            self._file.write(json.dumps({"robot": self._robot, **decision.to_dict()}) + "\n")
            self._file.flush()
        except OSError as error:
            raise RecordingFailed(f"{self._path} could not be written: {error.strerror}") from error
        self._display.step(str(decision))
