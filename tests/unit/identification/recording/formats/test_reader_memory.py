"""Every reader yields blocks: three times as many rows need no more memory."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import orjson
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from armload_identification.recording.formats import ros_reader
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.reader_registry import reader_of
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.run_format import SCHEMA_NAME, TOPIC

FEW = 18_000
FEW_MESSAGES, SMALL_BLOCK = 300, 128
"""More than two blocks of every reader; reading ROS messages is slow under tracemalloc, so their blocks are smaller."""
JOINTS = 6
LONG = 1200
"""Length of a name, so that the messages fill more than one of the library's chunks."""
STATE = "sensor_msgs/msg/JointState"


def write_csv(path, rows):
    header = ",".join(["t", *(f"q{j}" for j in range(JOINTS)), *(f"tau{j}" for j in range(JOINTS))])
    line = ",".join(["0.123456789"] * (1 + 2 * JOINTS))
    path.write_text("\n".join([header, *[line] * rows]))


def write_mcap(path, rows):
    data = orjson.dumps(
        {
            "time_s": 1.0,
            "phase_s": None,
            "position_rad": [0.123456789] * JOINTS,
            "torque_nm": [0.123456789] * JOINTS,
            "missing": [False] * JOINTS,
        }
    )
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=2**18)
        writer.start()
        channel = writer.register_channel(TOPIC, "json", writer.register_schema(SCHEMA_NAME, "jsonschema", b"{}"))
        for row in range(rows):
            writer.add_message(channel, row, data, row)
        writer.finish()


def write_ros(plugin):
    def write(path, rows):
        store = get_typestore(Stores.ROS2_HUMBLE)
        stamp = store.types["builtin_interfaces/msg/Time"](1, 1)
        header = store.types["std_msgs/msg/Header"](stamp, "")
        names, numbers = [f"{j}".zfill(LONG) for j in range(JOINTS)], np.zeros(JOINTS)
        raw = store.serialize_cdr(store.types[STATE](header, names, numbers, numbers, numbers), STATE)
        with Writer(path, version=8, storage_plugin=plugin) as writer:
            connection = writer.add_connection("/joint_states", STATE, typestore=store)
            for row in range(rows):
                writer.write(connection, row, raw)

    return write


def write_npz(path, rows):
    np.savez_compressed(path, t=np.zeros(rows), q=np.zeros((rows, JOINTS)), tau=np.zeros((rows, JOINTS)))


def write_parquet(path, rows):
    rng = np.random.default_rng(1)
    names = ["t", *(f"q{j}" for j in range(JOINTS)), *(f"tau{j}" for j in range(JOINTS))]
    pq.write_table(pa.table({name: rng.normal(size=rows) for name in names}), path, row_group_size=5000)


WRITERS = {
    "run.csv": write_csv,
    "run.mcap": write_mcap,
    "bag_sqlite": write_ros(StoragePlugin.SQLITE3),
    "bag_mcap": write_ros(StoragePlugin.MCAP),
    "run.npz": write_npz,
    "run.parquet": write_parquet,
}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.long
def test_memory_does_not_grow_with_the_file(tmp_path, monkeypatch, name):
    monkeypatch.setattr(ros_reader, "_BLOCK_ROWS", SMALL_BLOCK)
    peaks = []
    few = FEW_MESSAGES if name.startswith("bag") else FEW
    for rows in (few // 10, few, 3 * few):  # the first loads the libraries
        path = tmp_path / str(len(peaks)) / name
        path.parent.mkdir()
        WRITERS[name](path, rows)
        reader, account = reader_of(path, ReadingOptions()), ReadingAccount()
        tracemalloc.start()
        found = sum(block.size for block in reader.blocks(account))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert found == account.rows_read == rows
    assert peaks[2] < 1.1 * peaks[1], peaks


def test_every_reader_is_tried():
    """Those of other packages and of frames have arrays, which are in memory before."""
    formats = {file.stem for file in Path(ros_reader.__file__).parent.glob("*_reader.py")}
    tried = {f"{kind}_reader" for kind in ("csv", "mcap", "ros", "numpy", "parquet")}
    assert formats == tried | {"extension_reader", "frame_reader"}
