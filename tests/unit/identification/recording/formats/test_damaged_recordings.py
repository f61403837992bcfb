"""Damaged or malicious files: one-sentence errors, and bounded memory."""

from __future__ import annotations

import contextlib
import json
import random
import struct
import tracemalloc
import zlib
from functools import cache

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from armload_identification.identification_errors import IdentificationError, RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_format import RUN_ATTACHMENT, SCHEMA_NAME, TOPIC
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.recorded_run import Run
from tests.recording_files import table_columns

pytestmark = pytest.mark.pure

ROWS = 60


def write_mcap(path, compression, topic=TOPIC, attachments=(), schema=b"{}"):
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=3000, compression=compression)
        writer.start()
        for name, text in attachments:
            writer.add_attachment(0, 0, name, "text/plain", text)
        number = writer.register_schema(SCHEMA_NAME, "jsonschema", schema)
        channel = writer.register_channel(topic, "json", number)
        for k in range(ROWS):
            angle = 0.1 * k
            message = {
                "cycle": k,
                "time_s": 5.0 + 0.01 * k,
                "phase_s": None,
                "segment": "periods",
                "position_rad": [np.sin(angle), np.cos(angle)],
                "current_a": [1.0, angle],
                "missing": [False, False],
            }
            writer.add_message(channel, 0, json.dumps(message).encode(), 0)
        writer.finish()
    return path.read_bytes()


@pytest.fixture(scope="module", params=[CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4])
def whole(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "run.mcap"
    attachments = [(RUN_ATTACHMENT, b'{"load": "loaded"}'), ("more", b"x" * 100)]
    return path, write_mcap(path, request.param, attachments=attachments)


def read_or_refuse(path):
    """The rows that were read; None if the file was rejected in one sentence."""
    try:
        recording = read_recording_file(path)
        recording.source.run()
    except IdentificationError as error:
        text = str(error)
        assert str(path) in text
        assert len(text) < 700
        return None
    assert np.isfinite(recording.position_rad).all()
    return recording.size


def test_one_flipped_bit_anywhere_is_survived(whole):
    path, content = whole
    rng = random.Random(6)
    read = []
    for place in sorted(rng.sample(range(8, len(content)), 110)):
        damaged = bytearray(content)
        damaged[place] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        read.append(read_or_refuse(path))
    assert None in read
    assert ROWS in read


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    edits=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 40), st.binary(max_size=20)), min_size=1, max_size=4)
)
def test_pieces_cut_out_and_put_in_are_survived(whole, edits):
    path, content = whole
    for place, cut, piece in edits:
        start = 8 + place % (len(content) - 8)
        content = content[:start] + piece + content[start + cut :]
    path.write_bytes(content)
    read_or_refuse(path)


def mcap_of(*records):
    """A file of the given records: kind and content."""
    return b"\x89MCAP0\r\n" + b"".join(struct.pack("<BQ", kind, len(content)) + content for kind, content in records)


def text_of(value):
    return struct.pack("<I", len(value)) + value


def chunk_of(compression, data, size, checksum=0):
    return struct.pack("<QQQI", 0, 0, size, checksum) + text_of(compression) + struct.pack("<Q", len(data)) + data


BOMB_BYTES = 2**28
BOMBS = {
    "zstd": zstandard.compress,
    "zstd unsized": zstandard.ZstdCompressor(write_content_size=False).compress,
    "lz4": lz4.frame.compress,
}


@cache
def bomb(kind):
    return BOMBS[kind](bytes(BOMB_BYTES))


@pytest.mark.parametrize(
    ("compression", "data", "size"),
    [
        (b"zstd", "zstd", 1000),
        (b"zstd", "zstd", BOMB_BYTES),
        (b"zstd", "zstd unsized", 1000),
        (b"lz4", "lz4", 1000),
        (b"lz4", "lz4", BOMB_BYTES),
        (b"", b"x", 2**62),
        (b"zstd", b"nothing", 1000),
        (b"lz4", b"nothing", 1000),
        (b"lz4", lz4.frame.compress(bytes(1000))[:-8], 1000),
        (b"xz", b"nothing", 7),
        (b"\xff\xfe", b"", 0),
    ],
    ids=[
        "zstd",
        "zstd sized",
        "zstd unsized",
        "lz4",
        "lz4 sized",
        "plain",
        "no zstd",
        "no lz4",
        "cut lz4",
        "xz",
        "utf-8",
    ],
)
def test_chunks_that_are_no_chunks_take_no_memory(tmp_path, compression, data, size):
    path = tmp_path / "bomb.mcap"
    path.write_bytes(mcap_of((6, chunk_of(compression, bomb(data) if isinstance(data, str) else data, size))))
    tracemalloc.start()
    with pytest.raises(RecordingError, match=r"bomb\.mcap: damaged, .*Copy the file again"):
        read_recording_file(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6


def channel_record(topic, number=1):
    return 4, struct.pack("<HH", number, 1) + text_of(topic) + text_of(b"json") + struct.pack("<I", 0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            mcap_of(channel_record(b"/joint_states"), channel_record(b"/tf", 2)),
            "no usable message .* /joint_states, /tf",
        ),
        (mcap_of(channel_record(b"/\xff\xfe")), "damaged, .*utf-8"),
        (mcap_of((4, b"\x01")), "damaged"),
        (mcap_of((6, chunk_of(b"", b"\x05\x00", 2))), "damaged, a chunk ends in the middle of a record"),
        (mcap_of((6, chunk_of(b"", struct.pack("<BQ", 5, 99), 9))), "damaged, a record is longer than its chunk"),
        (mcap_of((6, chunk_of(b"", b"x", 1, zlib.crc32(b"y")))), "damaged, the checksum of a chunk is wrong"),
        (mcap_of((9, b"\x00" * 20)), "damaged, EndOfFile"),
        (mcap_of((9, struct.pack("<QQ", 0, 0) + text_of(b"\xff") * 2 + bytes(12))), "damaged, .*utf-8"),
        (b"\x89MCAP0\r\n", "nothing was recorded"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, content, said):
    path = tmp_path / "bad.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=said):
        read_recording_file(path)


def test_messages_with_many_joints_take_no_memory(tmp_path):
    rows = [json.dumps({"time_s": 0, "phase_s": None, "position_rad": [0] * n}).encode() for n in (1000, 2000)]
    message = [(5, struct.pack("<HIQQ", 1, 0, 0, 0) + row) for row in rows]
    path = tmp_path / "wide.mcap"
    for record, said in zip(
        message, ("neither motor current nor joint torque", "damaged, its messages have 2000"), strict=True
    ):
        path.write_bytes(mcap_of(channel_record(TOPIC.encode()), record))
        tracemalloc.start()
        with pytest.raises(RecordingError, match=said):
            read_recording_file(path)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 50e6


@pytest.mark.parametrize("run", ["[" * 100_000, '{"a": ' * 5000, "1" * 10_000, "\xff", "[]", '"'])
def test_a_run_that_is_described_by_nonsense_is_refused(tmp_path, run):
    path = tmp_path / "a.mcap"
    write_mcap(path, CompressionType.NONE, attachments=[(RUN_ATTACHMENT, run.encode("latin-1"))])
    recording = read_recording_file(path)
    assert recording.joint_names == ()
    with pytest.raises(RecordingError, match=r"run\.json is damaged"):
        recording.source.run()


def timed_csv(path, unit_s, interval_s=0.002, velocity=False):
    """A log with times in a unit of `unit_s` seconds."""
    time_s = interval_s * np.arange(400)
    table = [1000.0 + time_s / unit_s, np.sin(time_s), np.cos(2 * time_s)]
    table += [np.cos(time_s), -2 * np.sin(2 * time_s)] if velocity else []
    np.savetxt(path, np.column_stack([*table, time_s, time_s]), delimiter=",", fmt="%.12g")
    return ReadingOptions(table_columns(0, [1, 2], [3, 4] if velocity else None, torque=[len(table), len(table) + 1]))


@pytest.mark.parametrize(("unit_s", "name"), [(1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds")])
@pytest.mark.parametrize("interval_s", [0.001, 0.002, 0.008, 0.1])
def test_times_in_another_unit_are_recognised(tmp_path, unit_s, name, interval_s):
    path = tmp_path / "log.csv"
    with pytest.raises(RecordingError, match=f"expected seconds.* They look like {name}"):
        read_recording_file(path, timed_csv(path, unit_s, interval_s))


@pytest.mark.parametrize(("unit_s", "name"), [(1e-3, "milliseconds"), (1e-6, "microseconds")])
def test_velocities_show_the_unit_of_a_fast_log(tmp_path, unit_s, name):
    path = tmp_path / "log.csv"
    with pytest.raises(RecordingError, match=f"time stamps look like {name}"):
        read_recording_file(path, timed_csv(path, unit_s, 0.3 * unit_s, velocity=True))


def test_joints_that_creep_show_the_milliseconds_of_a_fast_log(tmp_path):
    """3.3 kHz: in ms, an interval that could be that of a slow log in s."""
    path = tmp_path / "log.csv"
    with pytest.raises(RecordingError, match=r"log.csv: .* is 0.3, .* 0.001 rad/s. The time stamps look like milli"):
        read_recording_file(path, timed_csv(path, 1e-3, 3e-4))
    assert read_recording_file(path, timed_csv(path, 1.0, 0.3)).size == 400


def test_a_log_with_hardly_any_rows_in_its_time_asks_for_no_memory():
    time_s = np.concatenate([2e-5 * np.arange(40), [50.0]])
    position = np.column_stack([np.sin(time_s), np.cos(time_s)])
    run = Recording.from_arrays(time_s, position, torque_nm=position)
    with pytest.raises(RecordingError, match="41 rows, mostly 2e-05 s apart, in 50 s: most of the motion is missing"):
        _ = Run.of(run, Transmission(np.ones(2), np.eye(2))).motion


def test_no_time_between_rows_is_no_time():
    time_s = 1e-9 * np.arange(40)
    with pytest.raises(RecordingError, match=r"1e-09, expected seconds.*Check the column"):
        Recording.from_arrays(time_s, np.zeros((40, 2)), torque_nm=np.ones((40, 2)))


@settings(max_examples=80, deadline=None, derandomize=True)
@given(text=st.text(st.sampled_from('0123456789.,-e \n\t"naif\x00\x1bä'), max_size=600))
def test_any_table_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    path.write_text(text)
    with contextlib.suppress(RecordingError):
        read_recording_file(path, ReadingOptions(table_columns(0, [1], torque=[2])))
