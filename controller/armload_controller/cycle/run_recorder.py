"""The recorder: one MCAP file per run, in the format of `armload_identification.recording.recording`.

A run is recorded as NAME.partial.mcap and renamed when complete, so that an interrupted run is never mistaken for a
complete one and can be repeated. The file is append-only: every `FLUSH_S` of recorded time the current chunk is closed
and written to the operating system, so that a crash or kill -9 loses less than a quarter of a second.
"""

from __future__ import annotations

import io
import os
import time
from array import array
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import Self

import numpy as np
import orjson
from mcap.writer import Writer

from armload_controller.control_errors import CommissioningError, RecordingFailed
from armload_controller.cycle.arm_frames import FRAMES_SCHEMA, FRAMES_SCHEMA_NAME, FRAMES_TOPIC, ArmFrames
from armload_controller.cycle.lateness import Lateness
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.leg_interpolator import Reference
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.float_array import FloatArray
from armload_identification.recording.run_format import (
    EVENT_SCHEMA_NAME,
    EVENTS_TOPIC,
    LATENESS_ATTACHMENT,
    MESSAGE_SCHEMA,
    SCHEMA_NAME,
    TOPIC,
)
from armload_identification.results.json_document import event_schema

FLUSH_S = 0.2
"""Recorded time between two flushes; at most a quarter of a second is guaranteed."""


FRAMES_S = 0.05
"""Recorded time between two messages with the links' frames, which serve display only."""


class Recorder:
    """Writes one run; a context manager that leaves a readable, indexed file however the run ends.

    It is a plug-in of the cycle. A run without rows leaves no file; one that ends with an error keeps its partial name.

    Args:
        path: File to write; it must not exist.
        attachments: Text by name, written first.
        frames: Frames of the arm's links, recorded every `FRAMES_S` for Foxglove; None if the arm is unknown.
        lateness: Counts late cycles, to be attached at the end; None if this program does not run the cycle.
        clock_ns: Wall-clock time in ns since 1970; read once, at the first row.

    Attributes:
        rows: Number of rows written.
        partial: The file of a run that has not ended, or has ended with an error.

    Raises:
        CommissioningError: the file exists or cannot be written.
    """

    name = "recorder"

    def __init__(
        self,
        path: Path,
        attachments: Mapping[str, str],
        *,
        frames: ArmFrames | None = None,
        lateness: Lateness | None = None,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._frames, self._lateness, self._clock_ns = frames, lateness, clock_ns
        self._started_ns: int | None = None
        self._events_channel: int | None = None
        self._framed_s = -float("inf")
        self._path, self.partial = path, _partial_of(path)
        if path.exists():
            raise CommissioningError(f"{path} exists: recordings are never overwritten, choose another --output")
        try:
            self._file: io.BufferedWriter = self.partial.open("xb")
            self._begin(attachments)
        except OSError as error:
            raise CommissioningError(f"{path}: {error.strerror}: choose an --output that can be written") from error
        self._flushed_s = -float("inf")
        self.rows = 0
        self._phase_s, self._time_s = array("d"), array("d")

    def _begin(self, attachments: Mapping[str, str]) -> None:
        """Write everything before the first row; on a full disk this fails before anything is switched on."""
        self._writer = Writer(self._file)
        try:
            self._writer.start(profile="", library="armload")
            for name, text in attachments.items():
                self._attach(name, text.encode())
            schema = self._writer.register_schema(SCHEMA_NAME, "jsonschema", orjson.dumps(MESSAGE_SCHEMA))
            self._channel = self._writer.register_channel(TOPIC, "json", schema)
            if self._frames is not None:
                schema = self._writer.register_schema(FRAMES_SCHEMA_NAME, "jsonschema", orjson.dumps(FRAMES_SCHEMA))
                self._frames_channel = self._writer.register_channel(FRAMES_TOPIC, "json", schema)
            self._file.flush()
        except OSError:
            with suppress(OSError):
                self._file.close()
            with suppress(OSError):
                self.partial.unlink()
            raise

    def attach(self, name: str, text: str) -> None:
        """Add an attachment after the recorder was opened.

        Args:
            name: Name of the attachment.
            text: Its content.

        Raises:
            RecordingFailed: it could not be written.
        """
        try:
            self._attach(name, text.encode())
            self._file.flush()
        except OSError as error:
            raise self._failed(error) from error

    @property
    def measured(self) -> tuple[FloatArray, FloatArray]:
        """Phases and times of the rows within the measured periods."""
        return np.array(self._phase_s), np.array(self._time_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        failure: OSError | None = None

        def name_it() -> None:
            if not self.rows:
                self.partial.unlink()
            elif error is None and failure is None:
                self.partial.rename(self._path)

        for step in (self._attach_lateness, self._writer.finish, self._flush_to_disk, self._file.close, name_it):
            try:
                step()
            except OSError as problem:
                failure = failure or problem
        if failure is not None and error is None:
            raise self._failed(failure) from failure

    def on_cycle(self, step: CycleStep) -> None:
        """Record the last command with the feedback that belongs to it."""
        reference = step.sent_reference
        if step.sent is None or reference is None:
            if self._lateness is not None:
                self._lateness.begin()
            return
        if self._lateness is not None:
            self._lateness.note(step.feedback.time_s)
        self.write(step.feedback, step.sent, reference.segment, phase_of(reference))

    def write(
        self,
        feedback: JointFeedback,
        command: JointCommand | None,
        segment: str,
        phase_s: float | None,
        target_torque_nm: FloatArray | None = None,
    ) -> None:
        """Record one cycle.

        Args:
            feedback: Feedback of the drives.
            command: The command it belongs to; None if unknown.
            segment: One of those of `run_format.MESSAGE_SCHEMA`.
            phase_s: Phase along the excitation; None outside the measured periods.
            target_torque_nm: Joint torque that the arm's own controller calculated; None if unknown.

        Raises:
            RecordingFailed: the disk is full, or another error of the file.
        """
        if self._started_ns is None:
            self._started_ns = self._clock_ns() - round(feedback.time_s * 1e9)
        stamp_ns = self._started_ns + round(feedback.time_s * 1e9)
        row = joint_row(feedback, command, segment, phase_s)
        if target_torque_nm is not None:
            row["target_torque_nm"] = target_torque_nm
        data = orjson.dumps(row, option=orjson.OPT_SERIALIZE_NUMPY)
        try:  # in every cycle: a context manager would cost a microsecond
            self._writer.add_message(self._channel, stamp_ns, data, stamp_ns, feedback.cycle)
            self.rows += 1
            if phase_s is not None:
                self._phase_s.append(phase_s)
                self._time_s.append(feedback.time_s)
            if self._frames is not None and feedback.time_s - self._framed_s >= FRAMES_S:
                data = self._frames.message(feedback.position_rad, stamp_ns)
                self._writer.add_message(self._frames_channel, stamp_ns, data, stamp_ns, feedback.cycle)
                self._framed_s = feedback.time_s
            if feedback.time_s - self._flushed_s >= FLUSH_S:
                self._writer.flush()
                if os.fstat(self._file.fileno()).st_nlink == 0:
                    raise RecordingFailed(f"{self.partial} was removed while it was being written")
                self._flushed_s = feedback.time_s
        except OSError as error:
            raise self._failed(error) from error

    def write_event(self, time_s: float, event: Mapping[str, object]) -> None:
        """Record an event of the recorded arm; before the first row there is none.

        Args:
            time_s: When it happened, on the clock of the rows.
            event: According to `json_document.event_schema`.

        Raises:
            RecordingFailed: the disk is full, or another error of the file.
        """
        if self._started_ns is None:
            return
        stamp_ns = self._started_ns + round(time_s * 1e9)
        try:
            if self._events_channel is None:
                schema = self._writer.register_schema(EVENT_SCHEMA_NAME, "jsonschema", orjson.dumps(event_schema()))
                self._events_channel = self._writer.register_channel(EVENTS_TOPIC, "json", schema)
            self._writer.add_message(self._events_channel, stamp_ns, orjson.dumps(event), stamp_ns)
        except OSError as error:
            raise self._failed(error) from error

    def _attach_lateness(self) -> None:
        """Attach how late the cycles were, if there were any."""
        counted = {} if self._lateness is None else self._lateness.counted()
        if counted:
            self._attach(LATENESS_ATTACHMENT, orjson.dumps(counted))

    def _attach(self, name: str, content: bytes) -> None:
        kind = "application/json" if name.endswith(".json") else "application/toml"
        self._writer.add_attachment(0, 0, name, kind, content)

    def _flush_to_disk(self) -> None:
        """Force the data to disk, so that a file with its final name is complete there."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def _failed(self, error: OSError) -> RecordingFailed:
        return RecordingFailed(f"{self.partial} could not be written: {error.strerror}")


def phase_of(reference: Reference) -> float | None:
    """Phase of a reference along the excitation, in s; None outside the measured periods."""
    return reference.state.phase_s if reference.segment is Segment.PERIODS else None


def joint_row(
    feedback: JointFeedback, command: JointCommand | None, segment: str, phase_s: float | None
) -> dict[str, object]:
    """One cycle as a message of `run_format.MESSAGE_SCHEMA`.

    Args:
        feedback: Feedback of the drives.
        command: The command it belongs to; None if unknown.
        segment: The part of the run, one of those of the schema.
        phase_s: Phase along the excitation; None outside the measured periods.
    """
    row: dict[str, object] = {
        "cycle": feedback.cycle,
        "time_s": feedback.time_s,
        "phase_s": phase_s,
        "segment": segment,
    }
    if command is not None:
        row["command_position_rad"] = command.position_rad
    row["position_rad"] = feedback.position_rad
    for key in ("velocity_rad_s", "current_a", "torque_nm"):
        values = getattr(feedback, key)
        if values is not None:
            row[key] = values
    if command is not None:
        row["torque_offset_nm"] = command.torque_offset_nm
    row["statusword"] = feedback.statusword
    row["missing"] = feedback.missing
    return row


def _partial_of(path: Path) -> Path:
    """A free name for the incomplete run; files of earlier attempts are kept."""
    suffixes = chain(("",), (f"-{attempt}" for attempt in count(2)))
    partials = (path.with_name(f"{path.stem}.partial{suffix}.mcap") for suffix in suffixes)
    return next(partial for partial in partials if not partial.exists())
