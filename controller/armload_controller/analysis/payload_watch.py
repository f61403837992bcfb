"""Watch the payload of a calibrated arm sample by sample, in a recording that is finished or still growing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from armload_controller.analysis.arm_in_use import Calibration, arm_in_use
from armload_controller.analysis.payload_events import PayloadEvent, PayloadEvents
from armload_controller.analysis.stated_drift import NOTHING_STATED, StatedDrift
from armload_controller.config.objects_or_paths import FilePath, arm_of
from armload_controller.config.robot_recordings import MeasuredArm
from armload_drivers.listening.overheard_arm import ToldPayload
from armload_identification.argument_types import path_of, require_type
from armload_identification.contact.force_watch import Force
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.recording.garbage_rows import GarbageFilter
from armload_identification.recording.read_boundary import reading
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.reader_registry import reader_of
from armload_identification.recording.reading_options import Effort, ReadingOptions
from armload_identification.recording.row_block import RowBlock
from armload_identification.result_table import PrintedResult, ResultTable
from armload_identification.results.json_document import json_document

SHOWN_S: Final = 3.0
"""Time in motion after which an estimate is shown."""
SILENT_S: Final = 3.0
"""Silence of the source after which there is no present estimate."""
NOTED_S: Final = 10.0
"""Time in motion after which it is said what of a drift of the gains the motion leaves possible."""
NEVER_LOOKED: Final = -2
IDLE_LOOKS: Final = 10
"""Number of looks without new data after which a recording counts as finished."""


@dataclass(frozen=True)
class HeardBus:
    """The state of an arm as received from its bus.

    Attributes:
        cycles: Number of cycles so far.
        missing: Per joint, number of cycles without its feedback.
        enabled: Whether the drives are in OPERATION ENABLED; otherwise no payload is estimated.
        silent_s: Time since the last frame.
        lost: Number of whole cycles lost, where that is known.
        told: The payload that the arm's controller was told; None if unknown.
    """

    cycles: int
    missing: tuple[int, ...]
    enabled: bool
    silent_s: float
    lost: int = 0
    told: ToldPayload | None = None


@dataclass(frozen=True, eq=False, repr=False)
class WatchedMoment(PrintedResult):
    """Everything known at one moment; prints as a table.

    Attributes:
        time_s: Time of the last sample; None before the first one.
        payload: The estimate; None if the arm is only recorded because it is not calibrated.
        events: Events since the previous moment.
        bus: State of the bus; None for a recording.
        force: Whether something acts on the moving arm; then the payload is that of before.
    """

    time_s: float | None
    payload: LivePayload | None
    events: tuple[PayloadEvent, ...] = ()
    bus: HeardBus | None = None
    force: Force = Force.FREE

    def table(self) -> ResultTable:
        """The payload, and the events below."""
        time = "" if self.time_s is None else f"{self.time_s:.2f}"
        payload = "not estimated" if self.payload is None else str(self.payload)
        events = tuple(str(event) for event in self.events)
        return ResultTable("", ("time s", "payload", "force"), [(time, payload, str(self.force))], (1, 2), events)

    def to_numbers(self) -> dict[str, Any]:
        """The estimate and the state of its source, without events: the fields of `to_dict`."""
        return {**_payload_fields(self.payload), "force": str(self.force), **(_bus_fields(self.bus) or {})}

    def to_dict(self, robot: str) -> dict[str, Any]:
        """Numbers, texts, lists and dictionaries: the schema `armload/watch/1`."""
        events = [asdict(event) for event in self.events]
        found = _payload_fields(self.payload) | {"force": str(self.force)}
        where = {"robot": robot, "time_s": self.time_s}
        return json_document("watch", where | found | {"events": events, "bus": _bus_fields(self.bus)})


def drift_note(moment: WatchedMoment) -> str | None:
    """What is assumed of the drift of the gains, and what it means for the mass; None while that is not determined."""
    found = moment.payload
    if found is None or found.gains is None or not found.determined[0] or found.moving_s.max() < NOTED_S:
        return None
    return found.gains.note(found.mass_kg, found.drifted_kg)


def _bus_fields(bus: HeardBus | None) -> dict[str, Any] | None:
    """The state of the source in a document."""
    if bus is None:
        return None
    told = bus.told and {"mass_kg": bus.told.mass_kg, "center_of_mass_m": list(bus.told.center_of_mass_m)}
    return asdict(bus) | {"missing": list(bus.missing), "told": told}


def _payload_fields(found: LivePayload | None) -> dict[str, Any]:
    """The estimate in a document; None in every field if there is no estimate."""
    if found is None:
        keys = ("mass_kg", "half_width_95_kg", "center_of_mass_m", "moving_s", "changes", "contact", "refused")
        return dict.fromkeys((*keys, "gain_drift", "drifted_kg"))
    center = zip(found.values[1:], found.determined[1:], strict=True)
    return {
        "mass_kg": found.mass_kg,
        "half_width_95_kg": float(found.half_width_95[0]),
        "center_of_mass_m": [float(value) if sure else None for value, sure in center],
        "moving_s": found.moving_s.tolist(),
        "changes": found.changes,
        "contact": found.contact,
        "refused": found.refused,
        "gain_drift": None if found.gains is None else found.gains.deviation,
        "drifted_kg": None if found.gains is None else found.drifted_kg,
    }


class PayloadWatch:
    """Watches one arm.

    Args:
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        every_s: Time between the moments that are shown of a recording.
        drift: What is stated of the drift of the gains since the calibration.

    Attributes:
        calibration: The arm, with gains as measured by a reference.
        effort: What it was calibrated with.

    Raises:
        EstimationError: the arm is not calibrated.
        CalibrationFileError: the calibration cannot be used.
        ModelError: it belongs to another arm.
        RecordingError: the reference of the drift cannot be used.
    """

    def __init__(
        self,
        robot: MeasuredArm,
        calibration: Calibration | None = None,
        every_s: float = 1.0,
        drift: StatedDrift = NOTHING_STATED,
    ) -> None:
        used = arm_in_use(robot, calibration)
        found = used.calibrated("identifying a payload during operation requires the arm's calibration")
        session = drift.session(robot, used)
        found = found if session is None else session.corrected(found)
        self._robot, self._every_s = robot, every_s
        self.calibration, self.effort = found, found.effort
        self._watched = WatchedPayload(found, robot.chain, robot.transmission, session)
        self._next_s: float | None = None
        self._last_s: float | None = None
        self._events = PayloadEvents(found, robot.joint_names)

    def file(self, path: Path) -> Iterator[WatchedMoment]:
        """The rows of a recording that have not been seen yet.

        Args:
            path: The recording; it may still grow.

        Returns:
            Moments; the last one at the end of what there is.

        Raises:
            RecordingError: it cannot be read, or does not fit arm or calibration.
        """
        seen = self._last_s
        for block in self._usable(path):
            yield from self.rows(path, block)
        if self._last_s != seen:
            yield self.moment()

    def _usable(self, path: Path) -> Iterator[RowBlock]:
        """The blocks of a recording without implausible rows."""
        options = ReadingOptions(joint_names=tuple(self._robot.joint_names), log_columns=self._robot.csv_columns)
        with reading(path):
            yield from GarbageFilter(path).valid(reader_of(path, options).blocks(ReadingAccount()))

    def rows(self, path: Path, block: RowBlock) -> Iterator[WatchedMoment]:
        """Process rows; those not later than the last one are skipped.

        Args:
            path: The recording, for messages.

        Raises:
            RecordingError: the rows lack the effort that the arm was calibrated with, or have other joints.
        """
        effort = block.torque_nm if self.effort is Effort.TORQUE else block.current_a
        if effort is None:
            raise RecordingError(
                f"{path}: no {self.effort}, which the arm was calibrated with. Record it, or recalibrate the arm from "
                "recordings like this one."
            )
        if block.position_rad.shape[1] != self._robot.chain.n:
            raise RecordingError(
                f"{path}: the recording has {block.position_rad.shape[1]} joints, the robot {self._robot.chain.n}. Use "
                "a recording and a configuration of the same arm."
            )
        fresh = 0 if self._last_s is None else int(np.searchsorted(block.time_s, self._last_s, side="right"))
        time_s, position, measured = (
            np.ascontiguousarray(values[fresh:]) for values in (block.time_s, block.position_rad, effort)
        )
        start = 0
        while start < time_s.size:
            if self._next_s is None:
                self._next_s = float(time_s[start]) + self._every_s
            end = int(np.searchsorted(time_s, self._next_s))
            self.take(time_s[start:end], position[start:end], measured[start:end])
            if end < time_s.size:
                yield self.moment()
                self._next_s = float(time_s[end]) + self._every_s
            start = end

    def take(self, time_s: FloatArray, position: FloatArray, effort: FloatArray) -> None:
        """Process samples.

        Args:
            time_s: (N,) stamps.
            position: (N, n) joint positions in rad.
            effort: (N, n) motor currents in A or reported joint torques in N m, as specified by `effort`.
        """
        self._watched.take(time_s, position, effort)
        if time_s.size:
            self._last_s = float(time_s[-1])

    @property
    def has_news(self) -> bool:
        """Whether something was noticed or decided since the last moment."""
        return self._watched.has_news

    def moment(self, bus: HeardBus | None = None, time_s: float | None = None) -> WatchedMoment:
        """The estimate, and the events since the previous moment.

        Args:
            bus: State of the bus, for an arm on its bus.
            time_s: Time of the last cycle there, whether or not it could be used.
        """
        found = self._watched.estimate()
        told = None if bus is None else bus.told
        events = (*self._events.of_forces(self._watched.take_events()), *self._events.of(found, told))
        return WatchedMoment(self._last_s if bus is None else time_s, found, events, bus, self._watched.force)


def watch(
    robot: MeasuredArm | FilePath,
    recording: FilePath,
    *,
    calibration: Calibration | None = None,
    every_s: float = 1.0,
    drift: StatedDrift = NOTHING_STATED,
) -> Iterator[WatchedMoment]:
    """The payload of a calibrated arm along a recording of any motion: its mass over time, grasped, released.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        recording: A recording of any format; one that still grows is read as far as it goes.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        every_s: Time between two moments.
        drift: The drift that all gains have in common since the calibration.

    Returns:
        Moments, each with the estimate and the events since the previous one.

    Raises:
        EstimationError: the arm is not calibrated.
        RecordingError: the recording cannot be read, or does not fit the arm.

    Examples:
        >>> import armload
        >>> runs = [f"runs/today/{load}_identification.mcap" for load in ("unloaded", "loaded")]
        >>> *_, last = armload.watch("er50", runs[1], calibration=armload.calibrate("er50", runs))
        >>> 9 < last.payload.mass_kg < 11
        True
    """
    require_type("drift", drift, StatedDrift)
    path = path_of("recording", recording)
    return PayloadWatch(arm_of(robot), calibration, every_s, drift).file(path)


def follow(watch: PayloadWatch, path: Path, wait: Callable[[float], None], every_s: float) -> Iterator[WatchedMoment]:
    """Watch a recording until it has its final name, or is no longer being written.

    Args:
        watch: The watch of the arm.
        path: The growing recording, such as NAME.partial.mcap.
        wait: Waits for the given time in s.
        every_s: Time between two looks.

    Yields:
        Moments.

    Raises:
        RecordingError: the recording does not exist, or does not fit the arm.
    """
    idle, size = 0, NEVER_LOOKED
    while idle < IDLE_LOOKS:
        grown = path.stat().st_size if path.exists() else -1
        if grown < 0 and size >= 0:
            return
        idle = idle + 1 if grown == size else 0
        if grown != size:
            size = grown
            yield from watch.file(path)
        wait(every_s)
