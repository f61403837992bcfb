"""Watching or recording an arm on its bus while another master drives it. Nothing is ever sent."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from armload_controller.analysis.payload_watch import HeardBus, PayloadWatch, WatchedMoment
from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.session.robot_recorder import robot_recorder
from armload_controller.session.session_load import SessionLoad
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.listening.overheard_arm import OverheardCycle, ToldPayload
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.run_format import OVERHEARD


def recorder_of(robot: Robot, path: Path, load: SessionLoad | None) -> Recorder:
    """A recorder for a motion under another master.

    Args:
        path: File to write; it must not exist.
        load: What the arm carries, if stated by the user.

    Raises:
        CommissioningError: the file exists or cannot be written.
    """
    return robot_recorder(robot, path, {"overheard": True} | ({} if load is None else {"load": load}))


def _effort_of_drives(robot: Robot) -> Effort:
    """What the configured drives report."""
    reported = {drive.feedback for drive in robot.drives.settings.drives}
    return Effort.CURRENT if EffortFeedback.CURRENT in reported else Effort.TORQUE


class BusWatch:
    """Processes overheard cycles: estimates, events, rows of a recording.

    While a drive is not enabled, its motor torque is not the joint's load: such cycles are neither used nor recorded.

    Args:
        payload: Estimates the payload; None to record only.
        recorder: Records; None to estimate only.
        every_s: Time between two moments.
        clock: Monotonic time in s, to measure silence.
        effort: What the cycles contain; None for what the configured drives report.

    Raises:
        CommissioningError: the cycles contain another kind of effort than the arm was calibrated with.
    """

    def __init__(
        self,
        robot: Robot,
        payload: PayloadWatch | None,
        recorder: Recorder | None,
        every_s: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        effort: Effort | None = None,
    ) -> None:
        reported = effort or _effort_of_drives(robot)
        if payload is not None and payload.effort is not reported:
            remedy = "Calibrate it from recordings of this bus (`armload watch --record`)"
            if effort is not None:
                remedy = f"Give --effort {payload.effort} if the topic's effort is that; else c{remedy[1:]}"
            raise CommissioningError(
                f"{robot.file}: the drives report {reported}, but the arm was calibrated "
                f"with {payload.effort}. {remedy}"
            )
        self._payload, self._recorder, self._every_s, self._clock = payload, recorder, every_s, clock
        self._n = robot.n

    def moments(self, cycles: Iterator[OverheardCycle | None], goes_on: Callable[[], bool]) -> Iterator[WatchedMoment]:
        """Watch until `goes_on` returns false.

        Args:
            cycles: Cycles as received; None while nothing is received.
            goes_on: Called before every cycle, and many times a second while there is none.

        Yields:
            Moments.

        Raises:
            BusError: the bus failed, or nothing is received.
            RecordingFailed: the recording could not be written.
        """
        count, shown, enabled, lost = 0, 0, False, 0
        time_s: float | None = None
        told: ToldPayload | None = None
        missing = np.zeros(self._n, dtype=np.int64)
        heard_s = shown_s = self._clock()
        next_s: float | None = None

        def moment(silent_s: float) -> WatchedMoment:
            return self._moment(time_s, HeardBus(count, tuple(missing.tolist()), enabled, silent_s, lost, told))

        while goes_on():
            cycle = next(cycles, None)
            now_s = self._clock()
            due = now_s - shown_s >= self._every_s
            if cycle is not None:
                heard_s, time_s, enabled = now_s, cycle.feedback.time_s, cycle.enabled
                count += 1
                lost, told = lost + cycle.lost, cycle.told
                missing += cycle.feedback.missing
                self._process(cycle)
                next_s = time_s + self._every_s if next_s is None else next_s
                due = time_s >= next_s or (self._payload is not None and self._payload.has_news)
            if due:
                shown, shown_s = count, now_s
                next_s = None if time_s is None else time_s + self._every_s
                yield moment(now_s - heard_s)
        if count > shown:
            yield moment(0.0)

    def _process(self, cycle: OverheardCycle) -> None:
        """Record one cycle and use it for the estimate, if the drives are enabled."""
        if not cycle.enabled:
            return
        if self._recorder is not None:
            self._recorder.write(cycle.feedback, cycle.command, OVERHEARD, None, cycle.target_torque_nm)
        if self._payload is not None and not cycle.feedback.missing.any():
            feedback = cycle.feedback
            effort = feedback.torque_nm if feedback.current_a is None else feedback.current_a
            self._payload.take(np.array([feedback.time_s]), feedback.position_rad[None], np.array([effort]))

    def _moment(self, time_s: float | None, bus: HeardBus) -> WatchedMoment:
        """The present moment."""
        if self._payload is None:
            return WatchedMoment(time_s, None, bus=bus)
        moment = self._payload.moment(bus, time_s)
        if self._recorder is not None:
            for event in moment.events:
                self._recorder.write_event(event.time_s, asdict(event))
        return moment
