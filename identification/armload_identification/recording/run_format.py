"""The format of recordings made by armload.

One MCAP file per run: a channel `TOPIC` with a JSON message per cycle according to `MESSAGE_SCHEMA`, log time =
wall-clock time of the SYNC, and the attachments named here; those known beforehand are written first so that they
survive a crash.
Further channels for visualisation are not read. `armload_controller.cycle.run_recorder` writes the format,
`formats.mcap_reader` reads it.
"""

from __future__ import annotations

import json
from pathlib import Path
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
CONFIGURATION_ATTACHMENT: Final = "configuration.toml"
EXCITATION_ATTACHMENT: Final = "excitation.toml"
RUN_ATTACHMENT: Final = "run.json"
"""JSON object: armload_version, robot, joints (their names), load ("unloaded" or "loaded"), cycle_hz, created."""
WAY_ROUND_ATTACHMENT: Final = "way_round.json"
"""JSON object, if the straight approach was not free: via_points_rad, the (V, n) intermediate positions."""
LATENESS_ATTACHMENT: Final = "lateness.json"
"""JSON object, written last: by how much the cycles came later after the one before than a period. up_to_ms: upper
edges of the bins; cycles: the count in each, and in one more; greatest_ms."""

MESSAGE_SCHEMA: Final[dict[str, Any]] = json.loads(Path(__file__).with_name("message_schema.json").read_bytes())
"""JSON Schema of a message: one cycle of all joints."""
