"""Small recordings as files: a run in the format of the controller, and a log in CSV."""

from __future__ import annotations

import json

import numpy as np
from mcap.writer import CompressionType, Writer

from armload_identification.recording.csv_columns import QUANTITIES_BY_KEY, CsvColumns
from armload_identification.recording.run_format import (
    MESSAGE_SCHEMA,
    SCHEMA_NAME,
    TOPIC,
)


def messages(rows=60, joints=2, **changes):
    """Cycles of a plausible run; `changes` replaces keys, None removes them."""
    out = []
    for k in range(rows):
        t = 0.01 * k
        message = {
            "cycle": k,
            "time_s": 5.0 + t,
            "phase_s": None if k < 10 else round(t - 0.1, 9),
            "segment": "ramp_up" if k < 10 else "periods",
            "command_position_rad": [0.0] * joints,
            "position_rad": [float(np.sin(3.0 * t + j)) for j in range(joints)],
            "velocity_rad_s": [float(3.0 * np.cos(3.0 * t + j)) for j in range(joints)],
            "current_a": [0.1 * k + j for j in range(joints)],
            "torque_offset_nm": [0.0] * joints,
            "statusword": [0x0637] * joints,
            "missing": [False] * joints,
        }
        message.update(changes)
        out.append({key: value for key, value in message.items() if value is not None or key == "phase_s"})
    return out


def write_mcap(path, content, attachments=(), compression=CompressionType.NONE, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, compression=compression, **options)
        writer.start()
        for name, text in attachments:
            writer.add_attachment(0, 0, name, "text/plain", text.encode())
        schema = writer.register_schema(SCHEMA_NAME, "jsonschema", json.dumps(MESSAGE_SCHEMA).encode())
        channel = writer.register_channel(TOPIC, "json", schema)
        other = writer.register_channel("/other", "json", schema)
        for message in content:
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, 0, data, 0)
            writer.add_message(other, 0, b'{"position_rad": [9, 9]}', 0)
        writer.finish()
    return path


def table_columns(time, position, velocity=None, current=None, torque=None, nanoseconds=None, **more):
    """Columns of a table, by quantity as far as given."""
    times = [time] if nanoseconds is None else [time, nanoseconds]
    groups = zip(QUANTITIES_BY_KEY.values(), (times, position, velocity, current, torque), strict=True)
    return CsvColumns({quantity: list(group) for quantity, group in groups if group is not None}, **more)


def write_csv(path, rows):
    path.write_text("\n".join(rows) + "\n")
    return path


def csv_rows(rows=60, scale=1.0, velocity_scale=1.0):
    t = 0.01 * np.arange(rows)
    table = np.column_stack(
        [
            900.0 + t,
            scale * np.sin(3.0 * t),
            scale * np.cos(2.0 * t),
            velocity_scale * 3.0 * np.cos(3.0 * t),
            velocity_scale * -2.0 * np.sin(2.0 * t),
            0.5 + t,
            -t,
        ]
    )
    return [",".join(f"{value:.5f}" for value in row) for row in table]
