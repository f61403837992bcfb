"""The moments and events of one watch, collected for its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from armload_controller.analysis.payload_watch import SHOWN_S, PayloadWatch, WatchedMoment, drift_note
from armload_controller.config.robot_recordings import MeasuredArm
from armload_identification.report.watch_report import WatchHistory, write_watch_report

_MARKED_EVENTS: Final = frozenset({"grasped", "dropped", "changed tool"})


class WatchDiary:
    """Collects the moments of one watch.

    Args:
        watching: The watch of the arm.
        watched: The recording or the bus, for the report.
    """

    def __init__(self, robot: MeasuredArm, watching: PayloadWatch, watched: str) -> None:
        self._robot, self._watching = robot, watching
        self._watched = watched
        self._rows: list[tuple[float, float, float, bool]] = []
        self._events: list[tuple[float, str, bool]] = []
        self._last_estimated: WatchedMoment | None = None
        self._drift = ""

    def add(self, moment: WatchedMoment) -> None:
        """Add a moment."""
        found = moment.payload
        self._events += [(each.time_s, str(each), each.kind in _MARKED_EVENTS) for each in moment.events]
        if found is None or moment.time_s is None:
            return
        known = bool(found.moving_s.max() >= SHOWN_S)
        self._rows.append((moment.time_s, found.mass_kg, float(found.half_width_95[0]), known))
        self._last_estimated = moment
        self._drift = drift_note(moment) or self._drift

    @property
    def empty(self) -> bool:
        """Whether nothing was estimated and nothing happened."""
        return not self._rows and not self._events

    def history(self) -> WatchHistory:
        """Everything collected so far."""
        time_s, mass_kg, width_kg, known = np.array(self._rows, dtype=np.float64).reshape(-1, 4).T
        return WatchHistory(
            robot=self._robot.name,
            description=self._robot.description,
            watched=self._watched,
            time_s=time_s,
            mass_kg=mass_kg,
            half_width_95_kg=width_kg,
            known=known > 0.0,
            events=self._events,
            joints=self._joints(),
            drift=self._drift,
        )

    def write(self, path: Path) -> None:
        """Write the report; an existing file is replaced.

        Raises:
            ReportError: the file cannot be written.
        """
        write_watch_report(path, self.history())

    def _joints(self) -> list[dict[str, Any]]:
        """Motion, friction change and lost feedback of every joint."""
        if self._last_estimated is None or self._last_estimated.payload is None:
            return []
        found, bus, arm = self._last_estimated.payload, self._last_estimated.bus, self._watching.calibration
        change = found.friction[0] + found.friction[1] * arm.middle_speed_rad_s
        missing = (0,) * arm.n if bus is None else bus.missing
        rows = zip(self._robot.joint_names, found.moving_s, change, arm.usual_change_nm, missing, strict=True)
        cells = ("name", "moving_s", "friction_nm", "usual_nm", "missing")
        return [dict(zip(cells, row, strict=True)) for row in rows]
