"""ROS 2 bags, written by `rosbags` in every storage format: joints by name, plausible stamps, rejected bags."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import sys
import tracemalloc
from contextlib import closing

import numpy as np
import pytest
import zstandard
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from armload_identification.identification_errors import ExtraMissing, RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.formats.ros_reader import _DEFINITIONS, RosReader, _bag_of
from armload_identification.recording.read_boundary import MOST_BYTES
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.reading_options import Effort, ReadingOptions

ROWS = 60
START_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000
NAMES = ["shoulder", "elbow", "wrist"]
TIME = 0.01 * np.arange(ROWS)
POSITION = np.sin(TIME[:, None] + np.arange(3))
VELOCITY = np.cos(TIME[:, None] + np.arange(3))
EFFORT = 5.0 * np.sin(3.0 * TIME[:, None] + np.arange(3))
STATE = "sensor_msgs/msg/JointState"


@pytest.fixture(scope="module")
def store():
    store = get_typestore(Stores.ROS2_HUMBLE)
    found = get_types_from_msg(_DEFINITIONS.read_text("utf-8"), STATE)
    store.register({name: kind for name, kind in found.items() if name not in store.fielddefs})
    return store


@pytest.fixture
def bag(tmp_path, store):
    """Write a bag of messages: topic, type, the bag's time in ns, and message; returns its folder."""

    def bag(messages, plugin=StoragePlugin.MCAP, compression=None, name="bag"):
        path = tmp_path / name
        writer = Writer(path, version=8, storage_plugin=plugin)
        if compression is not None:
            writer.set_compression(compression, CompressionFormat.ZSTD)
        with writer:
            connections = {}
            for topic, kind, when_ns, message in messages:
                if (topic, kind) not in connections:
                    connections[topic, kind] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic, kind], when_ns, store.serialize_cdr(message, kind))
        return path

    return bag


@pytest.fixture
def header(store):
    def header(stamp_ns):
        stamp = store.types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
        return store.types["std_msgs/msg/Header"](stamp, "")

    return header


@pytest.fixture
def state(store, header):
    """A JointState of some joints for one row."""

    def state(row, names=NAMES, stamp_ns=None, velocity=True, effort=True):
        order = [NAMES.index(name) for name in names]
        stamp = START_NS + STEP_NS * row if stamp_ns is None else stamp_ns
        nothing = np.zeros(0)
        return store.types[STATE](
            header(stamp),
            list(names),
            POSITION[row][order],
            VELOCITY[row][order] if velocity else nothing,
            EFFORT[row][order] if effort else nothing,
        )

    return state


def states(state, topic="/joint_states", late_ns=0, **changes):
    return [(topic, STATE, START_NS + STEP_NS * row + late_ns, state(row, **changes)) for row in range(ROWS)]


def assert_read(recording, names=tuple(NAMES)):
    order = [NAMES.index(name) for name in names]
    assert recording.joint_names == tuple(names)
    np.testing.assert_array_equal(recording.position_rad, POSITION[:, order])
    np.testing.assert_array_equal(recording.torque_nm, EFFORT[:, order])
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)


def test_messages_that_are_alike_are_read_at_once_with_the_same_numbers(bag, state):
    """One message of another frame, or of another order, is enough for all around it to be read singly."""
    names = [NAMES[1], NAMES[2], NAMES[0]]
    alike = read_recording_file(bag(states(state, names=names), name="alike"), ReadingOptions(joint_names=NAMES))
    others = states(state, names=names)
    others[7][3].header.frame_id, others[9] = "base", states(state)[9]
    singly = read_recording_file(bag(others, name="singly"), ReadingOptions(joint_names=NAMES))
    assert_read(alike)
    for name in ("time_s", "position_rad", "velocity_rad_s", "torque_nm"):
        np.testing.assert_array_equal(getattr(alike, name), getattr(singly, name))


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP], ids=str)
@pytest.mark.parametrize("compression", [None, CompressionMode.FILE, CompressionMode.MESSAGE], ids=str)
def test_every_storage_gives_the_same(bag, state, plugin, compression):
    path = bag(states(state), plugin, compression)
    recording = read_recording_file(path)
    assert_read(recording)
    np.testing.assert_array_equal(recording.velocity_rad_s, VELOCITY)
    assert recording.source.kind == "ros2"
    assert len(recording.source.sha256) == 64
    if compression is None:
        (file,) = [file for file in path.iterdir() if file.suffix in {".db3", ".mcap"}]
        assert_read(read_recording_file(file))
        (path / "metadata.yaml").unlink()
        assert_read(read_recording_file(path))


def bomb(compress):
    """A part in two pieces, the first of which is small; 3 GB of zeros are 90 kB."""
    return compress(bytes(1000)) + 17 * compress(bytes(MOST_BYTES // 16))


def zstd_bomb():
    return bomb(zstandard.ZstdCompressor(write_content_size=False).compress)


def in_a_message(folder):
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        database.execute("UPDATE messages SET data = ? WHERE id = 50", (zstd_bomb(),))
        database.commit()
    return folder


def in_a_file(folder):
    (file,) = folder.glob("*.db3.zstd")
    file.write_bytes(zstd_bomb())
    return folder


def in_a_chunk(folder):
    packed = zstd_bomb()
    chunk = struct.pack("<QQQII", 0, 0, 1000, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    header = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0)
    records = [struct.pack("<BQ", kind, len(content)) + content for kind, content in ((1, header), (6, chunk))]
    (folder / "chunk.mcap").write_bytes(b"\x89MCAP0\r\n" + b"".join(records))
    return folder / "chunk.mcap"


def in_a_chunk_of_ros_1(folder):
    packed, fields = bomb(bz2.compress), [b"op=\x05", b"compression=bz2", b"size=\xe8\x03\x00\x00"]
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    record = b"".join(struct.pack("<I", len(part)) + part for part in (header, packed))
    (folder / "first.bag").write_bytes(b"#ROSBAG V2.0\n" + record)
    return folder / "first.bag"


@pytest.mark.parametrize(
    ("compression", "placed"),
    [
        (CompressionMode.MESSAGE, in_a_message),
        (CompressionMode.FILE, in_a_file),
        (CompressionMode.FILE, in_a_chunk),
        (CompressionMode.FILE, in_a_chunk_of_ros_1),
    ],
)
def test_what_unpacks_to_more_than_the_budget_is_refused_before(bag, state, tmp_path, monkeypatch, compression, placed):
    """60 such messages took 3 GB of memory each, and a file all of the disk."""
    path = placed(bag(states(state), StoragePlugin.SQLITE3, compression))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    tracemalloc.start()
    with pytest.raises(RecordingError, match=f"{path.name}: damaged, a compressed part has more than {MOST_BYTES}"):
        read_recording_file(path)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()
    assert not list((tmp_path / "temporary").iterdir())


def test_a_message_that_is_larger_than_the_budget_is_refused(bag, state):
    path = bag(states(state), StoragePlugin.SQLITE3)
    (file,) = path.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        database.execute("UPDATE messages SET data = zeroblob(?) WHERE id = 50", (MOST_BYTES + 1,))
        database.commit()
    with pytest.raises(RecordingError, match=f"a message of {MOST_BYTES + 1} bytes, at most"):
        read_recording_file(path)


def test_the_order_of_the_joints_may_change_from_message_to_message(bag, state):
    messages = states(state)
    messages[1::2] = [
        (topic, kind, when, state(row, names=["wrist", "shoulder", "elbow"]))
        for row, (topic, kind, when, _) in list(enumerate(messages))[1::2]
    ]
    path = bag(messages)
    assert_read(read_recording_file(path))
    assert_read(
        read_recording_file(path, ReadingOptions(joint_names=["elbow", "wrist", "shoulder"])),
        ("elbow", "wrist", "shoulder"),
    )


def test_of_two_publishers_on_one_topic_the_arm_is_read(bag, state, store, header):
    """The gripper's messages are neither rows of the arm nor counted as malformed."""
    gripper = [
        ("/joint_states", STATE, START_NS + STEP_NS * row + 1, store.types[STATE](
            header(START_NS), ["finger"], np.array([0.02]), np.zeros(0), np.zeros(0)
        ))
        for row in range(ROWS)
    ]  # fmt: skip
    both = sorted([*states(state), *gripper], key=lambda message: message[2])
    recording = read_recording_file(bag(both))
    assert_read(recording)
    assert recording.source.rows_read == ROWS


def test_the_joints_that_are_wanted_decide_between_two_arms(bag, state, store, header):
    other = [
        ("/other", STATE, START_NS + STEP_NS * row, store.types[STATE](
            header(START_NS + STEP_NS * row), ["a", "b", "c", "d"], np.full(4, 1e-3 * row), np.zeros(4), np.ones(4)
        ))
        for row in range(ROWS)
    ]  # fmt: skip
    path = bag([*states(state), *other])
    assert_read(read_recording_file(path, ReadingOptions(joint_names=NAMES)))
    assert read_recording_file(path).joint_names == ("a", "b", "c", "d")


@pytest.mark.parametrize(
    ("stamp", "by_header"),
    [
        (lambda row: 0, False),
        (lambda row: 1, False),
        (lambda row: 10**18 - row, False),
        (lambda row: 1 + STEP_NS * row, True),
        (lambda row: 2 * STEP_NS * row, True),
    ],
)
def test_header_stamps_count_where_they_make_sense(bag, state, stamp, by_header):
    rng = np.random.default_rng(3)
    late = np.sort(rng.integers(0, STEP_NS // 2, ROWS))
    messages = [
        ("/joint_states", STATE, START_NS + STEP_NS * row + int(late[row]), state(row, stamp_ns=stamp(row)))
        for row in range(ROWS)
    ]
    stamps = [stamp(row) if by_header else when for row, (_, _, when, _) in enumerate(messages)]
    elapsed = (np.array(stamps) - stamps[0]) * 1e-9
    recording = read_recording_file(bag(messages))
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], elapsed, atol=1e-6)


def test_an_effort_may_be_a_current(bag, state):
    recording = read_recording_file(bag(states(state)), ReadingOptions(effort=Effort.CURRENT))
    np.testing.assert_array_equal(recording.current_a, EFFORT)
    assert recording.torque_nm is None


def test_messages_without_velocity_or_effort(bag, state):
    assert read_recording_file(bag(states(state, velocity=False))).velocity_rad_s is None
    messages = states(state)
    messages[7] = (*messages[7][:3], state(7, effort=False))
    recording = read_recording_file(bag(messages, name="one"))
    assert recording.source.reasons == {"not finite": 1}
    with pytest.raises(RecordingError, match="neither motor current nor joint torque"):
        read_recording_file(bag(states(state, effort=False), name="none"))


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP], ids=str)
def test_messages_of_ros2_control(bag, store, header, plugin):
    """SQLite bags contain no message definitions; rosbags knows only those of ROS itself."""
    value, dynamic, trajectory, point = (
        store.types[name]
        for name in (
            "control_msgs/msg/InterfaceValue",
            "control_msgs/msg/DynamicJointState",
            "control_msgs/msg/JointTrajectoryControllerState",
            "trajectory_msgs/msg/JointTrajectoryPoint",
        )
    )
    nothing = store.types["builtin_interfaces/msg/Duration"](0, 0)

    def points(*columns):
        return point(*columns[:2], np.zeros(0), columns[2], nothing)

    for name, message in (
        (
            "control_msgs/msg/DynamicJointState",
            lambda row: dynamic(
                header(START_NS + STEP_NS * row),
                NAMES,
                [
                    value(["effort", "position", "velocity"], np.array([EFFORT[row, j], POSITION[row, j], 0.0]))
                    for j in range(3)
                ],
            ),
        ),
        (
            "control_msgs/msg/JointTrajectoryControllerState",
            lambda row: trajectory(
                header(START_NS + STEP_NS * row),
                NAMES,
                points(np.zeros(3), np.zeros(3), np.zeros(3)),
                points(POSITION[row], VELOCITY[row], EFFORT[row]),
                points(np.zeros(3), np.zeros(3), np.zeros(3)),
            ),
        ),
    ):
        messages = [("/state", name, START_NS + STEP_NS * row, message(row)) for row in range(ROWS)]
        assert_read(read_recording_file(bag(messages, plugin, name=name.split("/")[-1])))


def test_bags_that_cannot_be_read_are_refused_in_a_sentence(bag, state, store, tmp_path):
    text = "std_msgs/msg/String"
    talk = [("/chatter", text, START_NS + k, store.types[text]("hello")) for k in range(5)]
    with pytest.raises(RecordingError, match="no joint positions; it has std_msgs/msg/String"):
        read_recording_file(bag(talk, name="talk"))
    path = bag(states(state), StoragePlugin.SQLITE3)
    (file,) = path.glob("*.db3")
    whole = file.read_bytes()
    for damaged in (whole[:5000], whole[:100] + b"\xff" * 3000 + whole[3100:]):
        file.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"damaged, |no joint positions|usable rows"):
            read_recording_file(path)
    (path / "metadata.yaml").write_text("nonsense: [")
    with pytest.raises(RecordingError, match=r"damaged, .*Copy"):
        read_recording_file(path)
    sqlite3.connect(tmp_path / "no.db3").execute("create table a (b)").connection.close()
    with pytest.raises(RecordingError, match=r"no\.db3: damaged, "):
        read_recording_file(tmp_path / "no.db3")
    (tmp_path / "two").mkdir()
    for name in ("a.db3", "b.db3"):
        (tmp_path / "two" / name).write_bytes(whole)
    with pytest.raises(RecordingError, match=r"no metadata.yaml and 2 storage files"):
        read_recording_file(tmp_path / "two")
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match=r"a folder of unknown format.*ROS bag"):
        read_recording_file(tmp_path / "empty")


def test_without_the_library_its_command_is_named(bag, state, monkeypatch):
    path = bag(states(state))
    monkeypatch.setitem(sys.modules, "rosbags", None)
    with pytest.raises(ExtraMissing, match=r"needs rosbags, which a plain installation .*pip install 'armload\[ros\]'"):
        read_recording_file(path)


def test_a_real_bag(shared_data):
    path = shared_data / "ros2" / "panda_exciting"
    recording = read_recording_file(path)
    assert recording.joint_names == tuple(f"fer_joint{k}" for k in range(1, 8))
    assert recording.size == 727
    assert recording.time_s[-1] - recording.time_s[0] == pytest.approx(24.2, abs=0.1)


def test_a_bag_of_ros_1(tmp_path):
    """`rosbag record` of ROS 1; the arm's joints have a prefix in it, and are in another order."""
    from rosbags.rosbag1 import Writer as FirstWriter

    old = get_typestore(Stores.ROS1_NOETIC)
    types, path = old.types, tmp_path / "run.bag"
    with FirstWriter(path) as writer:
        connection = writer.add_connection("/joint_states", STATE, typestore=old)
        for k in range(ROWS):
            stamp_ns = START_NS + k * STEP_NS
            stamp = types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
            names = [f"cell/{name}" for name in NAMES[::-1]]
            values = (POSITION[k, ::-1], VELOCITY[k, ::-1], EFFORT[k, ::-1])
            message = types[STATE](types["std_msgs/msg/Header"](k, stamp, ""), names, *(np.array(v) for v in values))
            writer.write(connection, stamp_ns, old.serialize_ros1(message, STATE))
    recording = read_recording_file(path, ReadingOptions(joint_names=NAMES)).named_joints(NAMES)
    np.testing.assert_allclose(recording.position_rad, POSITION)
    np.testing.assert_allclose(recording.torque_nm, EFFORT)
    assert recording.joint_names == tuple(NAMES)


@pytest.mark.parametrize("velocity", [True, False])
def test_alike_messages_are_not_read_one_by_one(bag, state, monkeypatch, velocity):
    """512 at a time; those without a quantity are, as its numbers are not where they would be."""
    path = bag(
        [("/joint_states", STATE, START_NS + STEP_NS * k, state(k % ROWS, velocity=velocity)) for k in range(600)]
    )
    singly = []
    one_by_one = RosReader._one_by_one

    def noted(reader, library, part, account):
        singly.append(len(part))
        return one_by_one(reader, library, part, account)

    monkeypatch.setattr(RosReader, "_one_by_one", noted)
    account = ReadingAccount()
    blocks = list(RosReader(path, ReadingOptions()).blocks(account))
    assert singly == ([] if velocity else [512, 88])
    assert [block.size for block in blocks] == [512, 88]
    assert account.rows_read == 600
    np.testing.assert_array_equal(blocks[1].position_rad, POSITION[(512 + np.arange(88)) % ROWS])
    np.testing.assert_array_equal(blocks[1].torque_nm, EFFORT[(512 + np.arange(88)) % ROWS])


@pytest.mark.parametrize(("first", "known"), [(400, True), (401, False)])
def test_joints_and_quantities_are_learnt_from_four_hundred_messages(bag, state, first, known):
    messages = [
        ("/joint_states", STATE, START_NS + STEP_NS * k, state(k % ROWS, effort=k >= first, velocity=False))
        for k in range(440)
    ]
    choice = RosReader(bag(messages), ReadingOptions())._choice
    assert (choice.names, choice.used) == (tuple(NAMES), (True, False, known))


@pytest.mark.parametrize(("stands", "by_header"), [(5, True), (7, False)])
def test_header_stamps_are_used_if_nine_of_ten_increase(bag, state, stands, by_header):
    """Of 59 steps between 60 messages 53.1."""
    stamps = START_NS + STEP_NS * np.maximum(np.arange(ROWS) - stands, 0)
    messages = [
        ("/joint_states", STATE, START_NS + STEP_NS * k, state(k, stamp_ns=int(stamps[k]))) for k in range(ROWS)
    ]
    assert RosReader(bag(messages), ReadingOptions())._choice.by_header is by_header


@pytest.mark.parametrize(
    ("text", "refused"), [(b"[" * 50, False), (b"[" * 51, True), (b"a: [1, {b: 2}]\n" * 90, False), (b"{[" * 26, True)]
)
def test_the_description_of_a_bag_is_nested_at_most_fifty_times(tmp_path, text, refused):
    (tmp_path / "metadata.yaml").write_bytes(text)
    if refused:
        with pytest.raises(ValueError, match="nested more than 50 times"):
            _bag_of(tmp_path)
    else:
        assert _bag_of(tmp_path) == tmp_path
