"""What `armload watch --ros2` publishes: the payload, its state, and events, for other ROS 2 nodes.

    /armload/ROBOT/payload   geometry_msgs/InertiaStamped    in the frame `flange`; only while the mass is determined
    /armload/ROBOT/events    std_msgs/String                 one JSON object each, as in `events` of `--json`
    /diagnostics             diagnostic_msgs/DiagnosticArray mass, interval, state, lost samples

A coordinate of the centre of mass that is not determined is NaN, and so is the inertia.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Final

from armload_controller.analysis.payload_watch import SHOWN_S, SILENT_S, WatchedMoment
from armload_controller.cycle.arm_frames import FLANGE_FRAME
from armload_drivers.feeds.ros2_messages import (
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    Inertia,
    InertiaStamped,
    KeyValue,
    Stamp,
    Text,
    Vector3,
)
from armload_drivers.feeds.ros2_participant import Ros2Participant
from armload_identification.contact.force_watch import Force

_FINE, _WARNING, _STALE = 0, 1, 3
_NAN: Final = float("nan")


class PayloadPublisher:
    """Publishes the moments of one arm.

    Args:
        participant: This process in the network.
        robot: Name of the robot.
        stamp_ns: The header stamp that belongs to a moment's time.
        clock_ns: The stamp of a moment before the first sample.
    """

    def __init__(
        self,
        participant: Ros2Participant,
        robot: str,
        stamp_ns: Callable[[float], int],
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._robot, self._stamp_ns, self._clock_ns = robot, stamp_ns, clock_ns
        self.node = f"/armload/{node_name(robot)}"
        self._payload = participant.publication(f"{self.node}/payload", InertiaStamped)
        self._events = participant.publication(f"{self.node}/events", Text)
        self._state = participant.publication("/diagnostics", DiagnosticArray)

    def publish(self, moment: WatchedMoment) -> None:
        """Publish a moment.

        Raises:
            BusError: the middleware failed.
        """
        stamp_ns = self._clock_ns() if moment.time_s is None else self._stamp_ns(moment.time_s)
        sec, nanosec = divmod(stamp_ns, 10**9)
        stamp, found = Stamp(sec, nanosec), moment.payload
        level, message = _state(moment)
        if level != _STALE and found is not None and found.determined[0] and found.moving_s.max() >= SHOWN_S:
            pairs = zip(found.values[1:], found.determined[1:], strict=True)
            center = Vector3(*(float(value) if sure else _NAN for value, sure in pairs))
            inertia = Inertia(found.mass_kg, center, _NAN, _NAN, _NAN, _NAN, _NAN, _NAN)
            self._payload.send(InertiaStamped(Header(stamp, FLANGE_FRAME), inertia))
        for event in moment.events:
            self._events.send(Text(json.dumps(asdict(event))))
        values = [KeyValue(key, json.dumps(value)) for key, value in moment.to_numbers().items() if value is not None]
        status = DiagnosticStatus(level, f"armload: payload of {self._robot}", message, self._robot, values)
        self._state.send(DiagnosticArray(Header(stamp, ""), [status]))


def node_name(robot: str) -> str:
    """A robot's name as that of a ROS node, in which only letters, digits and underscores are allowed."""
    name = re.sub(r"\W", "_", robot, flags=re.ASCII)
    return name if name[:1].isalpha() else f"arm_{name}"


def _state(moment: WatchedMoment) -> tuple[int, str]:
    """Level and message of a moment."""
    found, bus = moment.payload, moment.bus
    if bus is not None and not bus.cycles:
        return _STALE, "no joint states yet"
    if bus is not None and bus.silent_s > SILENT_S:
        return _STALE, f"no joint states for {bus.silent_s:.0f} s"
    if found is None:
        return _FINE, "recording"
    if found.contact or moment.force is not Force.FREE:
        return _WARNING, "contact" if found.contact else f"{moment.force}: the payload of before is held"
    if found.moving_s.max() < SHOWN_S or not found.determined[0]:
        return _FINE, "not determined yet"
    return _FINE, f"{found.mass_kg:z.3f} +- {found.half_width_95[0]:.3f} kg"
