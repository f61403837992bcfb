"""The format of recordings made by armload.

One MCAP file per run: a channel `TOPIC` with a JSON message per cycle according to `MESSAGE_SCHEMA`, log time =
wall-clock time of the SYNC, and the attachments named here; those known beforehand are written first so that they
survive a crash.
Further channels for visualisation are not read. `armload_controller.cycle.run_recorder` writes the format,
`formats.mcap_reader` reads it.
"""

from __future__ import annotations

from typing import Any, Final

MAGIC: Final = b"\x89MCAP0\r\n"
"""First bytes of an MCAP file."""
TOPIC: Final = "/joints"
SCHEMA_NAME: Final = "armload.Joints"
EVENTS_TOPIC: Final = "/events"
"""Events that `armload watch` found while it recorded; not read."""
EVENT_SCHEMA_NAME: Final = "armload.Event"
OVERHEARD: Final = "overheard"
"""Segment of motion commanded by another master."""
SEGMENTS: Final = ("approach", "slow", "ramp_up", "periods", "ramp_down", "return", "hold", OVERHEARD)
CONFIGURATION_ATTACHMENT: Final = "configuration.toml"
EXCITATION_ATTACHMENT: Final = "excitation.toml"
RUN_ATTACHMENT: Final = "run.json"
"""JSON object: armload_version, robot, joints (their names), load ("unloaded" or "loaded"), cycle_hz, created."""
WAY_ROUND_ATTACHMENT: Final = "way_round.json"
"""JSON object, if the straight approach was not free: via_points_rad, the (V, n) intermediate positions."""
LATENESS_ATTACHMENT: Final = "lateness.json"
"""JSON object, written last: by how much the cycles came later after the one before than a period. up_to_ms: upper
edges of the bins; cycles: the count in each, and in one more; greatest_ms."""


_NUMBERS: Final[dict[str, Any]] = {"type": "array", "items": {"type": "number"}}
MESSAGE_SCHEMA: Final[dict[str, Any]] = {
    "title": SCHEMA_NAME,
    "description": "One cycle of all joints, units in the names; current_a is per motor, the rest per joint.",
    "type": "object",
    "properties": {
        "cycle": {"type": "integer", "description": "SYNC number since connecting"},
        "time_s": {"type": "number", "description": "time stamp of that SYNC"},
        "phase_s": {
            "type": ["number", "null"],
            "description": "phase along the excitation; null outside the streamed whole periods",
        },
        "segment": {"type": "string", "enum": list(SEGMENTS)},
        "command_position_rad": {**_NUMBERS, "description": "target sent with this SYNC; absent if unknown"},
        "position_rad": {**_NUMBERS, "description": "measured at this SYNC"},
        "velocity_rad_s": {**_NUMBERS, "description": "absent if the drives do not report it"},
        "current_a": {**_NUMBERS, "description": "motor current; absent on arms that report torque"},
        "torque_nm": {**_NUMBERS, "description": "joint torque; absent on arms that report current"},
        "torque_offset_nm": {**_NUMBERS, "description": "joint torque added in the servo loop (60B2)"},
        "statusword": {"type": "array", "items": {"type": "integer"}},
        "missing": {
            "type": "array",
            "items": {"type": "boolean"},
            "description": "true if this cycle's feedback did not arrive and the last one is repeated",
        },
        "target_torque_nm": {**_NUMBERS, "description": "joint torque that the arm's controller calculated; not read"},
    },
    "required": ["cycle", "time_s", "phase_s", "segment", "position_rad", "missing"],
}
