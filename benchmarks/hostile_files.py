"""Damaged and hostile files through every parser: no traceback, at most 1 GB and 10 s of CPU, refusals name it.

    python -m benchmarks.hostile_files [COUNT] [FIRST]

Whole files of every format are damaged with their structure in mind: lengths and counts become huge, values of text
become what a parser may not expect, keys disappear, blocks are repeated, cut or exchanged. COUNT inputs (20,000) are
tried, from the seed FIRST (0); a failure is printed with its seed, and `FIRST` repeats it. The exit status is 1 if
there is one. Without the boundary of the readers (`recording/read_boundary.py`) there are hundreds.
"""

from __future__ import annotations

import json
import multiprocessing
import random
import shutil
import signal
import struct
import sys
import tempfile
import zipfile
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from mcap.writer import CompressionType
from rosbags.rosbag1 import Writer as FirstWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ControlError
from armload_controller.fleet.job_table import read_job_table
from armload_drivers.bring_up.description_file import read_description
from armload_drivers.driver_errors import DriverError
from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.mounted_runs import ArmRuns, MountedRun, WeighedPayload
from armload_identification.excitation.excitation_file import read_excitation
from armload_identification.files.calibration_file import read_calibration, write_calibration
from armload_identification.files.payload_file import read_payload, write_payload
from armload_identification.files.run_table import read_run_table
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from tests.foreign_tables import ARMS, DIALECTS, Run, urdf_of
from tests.recording_files import messages, write_mcap
from tests.unit.conftest import PinocchioArm

COUNT = 20_000
MOST_KB = 1_000_000
LONGEST_S = 10
ROWS = 60
STATE = "sensor_msgs/msg/JointState"
ROBOTS = Path("configs/armload_configs")
HUGE = (0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63, 2**64 - 1)
WORDS = (
    *("nan", "inf", "-1", "0", "1e999", "9" * 400, "", '"', "'", "[", "]]", "{", "}", "=", ",", ";", "\t", "\n", "\r"),
    *("\x00", "\x1b[2J", "\u202e", "\ud83d\ude00", "-->", "<!--", "reference://x", "file:///dev/zero", "../../etc"),
    *("x" * 140_000, "[" * 5000, "true", "null", "1979-05-27", "0x" + "f" * 300, "%", "\ufeff"),
)


class TooSlow(BaseException):
    """Not an `Exception`, so that no boundary takes it for a damaged file."""


def small_run():
    """A short run of an arm of six joints."""
    angle = 0.03 * np.arange(ROWS)[:, None] + np.arange(6)
    return Run(0.01 * np.arange(ROWS), 2.0 * np.sin(angle), 6.0 * np.cos(angle), 20.0 * np.sin(angle), ARMS["xArm"])


def write_bag(folder, plugin, compression=None, run=None):
    """A ROS 2 bag of joint states."""
    store, run = get_typestore(Stores.ROS2_HUMBLE), run or small_run()
    writer = Writer(folder, version=8, storage_plugin=plugin)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/joint_states", STATE, typestore=store)
        for k, time_s in enumerate(run.time_s):
            time_ns = round(1e9 * time_s)
            stamp = store.types["builtin_interfaces/msg/Time"](1_700_000_000 + time_ns // 10**9, time_ns % 10**9)
            header = store.types["std_msgs/msg/Header"](stamp, "")
            values = (run.position_rad[k], run.velocity_rad_s[k], run.torque_nm[k])
            message = store.types[STATE](header, list(run.names), *values)
            writer.write(connection, time_ns, store.serialize_cdr(message, STATE))
    return folder


def write_first_bag(path, run=None):
    """A ROS 1 bag of joint states."""
    store, run = get_typestore(Stores.ROS1_NOETIC), run or small_run()
    with FirstWriter(path) as writer:
        connection = writer.add_connection("/joint_states", STATE, typestore=store)
        for k, time_s in enumerate(run.time_s):
            time_ns = round(1e9 * time_s)
            stamp = store.types["builtin_interfaces/msg/Time"](1_700_000_000 + time_ns // 10**9, time_ns % 10**9)
            values = (run.position_rad[k], run.velocity_rad_s[k], run.torque_nm[k])
            message = store.types[STATE](store.types["std_msgs/msg/Header"](k, stamp, ""), list(run.names), *values)
            writer.write(connection, time_ns, store.serialize_ros1(message, STATE))
    return path


def small_payload():
    """A payload with all ten quantities."""
    body = InertialParameters.from_center_of_mass(2.5, [0.01, -0.02, 0.06], 0.004 * np.eye(3))
    known, interval = np.ones(10, dtype=bool), body.values[:, None] + np.array([-0.1, 0.1])
    covariance = MassCenterCovariance(1e-6 * np.eye(4), 20.0)
    return PayloadResult("flange", body, known, interval, np.ones(6), np.ones(6), Provenance("0", "0", {}), covariance)


def small_calibration():
    """The calibration of a simulated arm from an empty run and one with a weighed payload."""
    arm = PinocchioArm()
    trajectory = arm.trajectory(3, period_s=10.0)
    runs = tuple(
        MountedRun(arm.run(trajectory, load, seed=load, with_phase=False), "disc" if load else "")
        for load in (False, True)
    )
    given, made = ArmRuns(runs, {"disc": WeighedPayload(arm.payload.mass_kg)}), Provenance("0", "c" * 64, {})
    return calibrate_arm(given, arm.chain, arm.transmission, robot="six", made=made)


def whole_files(folder):
    """A whole file of every kind, with its parser: (name, path, parser)."""
    run, files = small_run(), []

    def add(name, path, parser=read_recording_file):
        files.append((name, Path(path), parser))

    for name in (
        "rtde_recorder",
        "german_excel",
        "ros2_echo",
        "matlab_timetable",
        "grafana",
        "plotjuggler",
        "libfranka",
    ):
        add(name, DIALECTS[name](run, folder / f"{name}.csv"))
    arm = ReadingOptions(joint_names=run.names, position_limits_rad=np.tile([-2.8, 2.8], (6, 1)))
    add("LeRobot", DIALECTS["lerobot"](run, folder / "lerobot.csv"), partial(read_recording_file, options=arm))
    names = {f"q{i}": run.position_rad[:, i] for i in range(6)} | {f"tau{i}": run.torque_nm[:, i] for i in range(6)}
    pq.write_table(pa.table({"t": run.time_s, **names}), folder / "run.parquet")
    add("Parquet", folder / "run.parquet")
    arrays = {"time_s": run.time_s, "position_rad": run.position_rad, "torque_nm": run.torque_nm}
    np.savez(folder / "plain.npz", **arrays, joint_names=np.array(run.names))
    np.savez_compressed(folder / "packed.npz", **arrays)
    add("NumPy", folder / "plain.npz")
    add("NumPy, compressed", folder / "packed.npz")
    for kind in CompressionType:
        path = write_mcap(folder / f"own-{kind.name}.mcap", messages(ROWS, 6), [("run.json", "{}")], kind)
        add(f"own MCAP, {kind.name}", path)
    add("ROS 2 MCAP", next(write_bag(folder / "bag_mcap", StoragePlugin.MCAP).glob("*.mcap")))
    add("ROS 2 folder", write_bag(folder / "bag_folder", StoragePlugin.MCAP))
    add("ROS 2 SQLite", next(write_bag(folder / "bag_db3", StoragePlugin.SQLITE3).glob("*.db3")))
    add("ROS 2 by file", write_bag(folder / "bag_file", StoragePlugin.SQLITE3, CompressionMode.FILE))
    add("ROS 2 by message", write_bag(folder / "bag_message", StoragePlugin.SQLITE3, CompressionMode.MESSAGE))
    add("ROS 1", write_first_bag(folder / "first.bag"))
    (folder / "arm.urdf").write_text(urdf_of(ARMS["UR"]))
    add("URDF", folder / "arm.urdf", read_urdf_arm)
    (folder / "runs.csv").write_text("recording,mounting,mass_kg\na.mcap,,\nb.mcap,disc,2.5\n")
    add("table of runs", folder / "runs.csv", read_run_table)
    (folder / "jobs.csv").write_text("arm,robot,loaded,unloaded\ncell,er50,a_*.mcap,b_*.mcap\n")
    add("table of jobs", folder / "jobs.csv", read_job_table)
    for path, parser in (
        *((ROBOTS / f"{name}.toml", load_robot) for name in ("er50", "prbt", "ur10e")),
        *((path, read_excitation) for path in sorted(ROBOTS.glob("*_*.toml"))),
        *((path, read_description) for path in sorted(Path("../shared/data/eds").glob("*.[de][cd][fs]"))[:3]),
    ):
        add(path.name, shutil.copy(path, folder / path.name), parser)
    write_payload(folder / "payload.toml", small_payload())
    add("payload", folder / "payload.toml", read_payload)
    write_calibration(folder / "arm.calibration.toml", small_calibration())
    add("calibration", folder / "arm.calibration.toml", read_calibration)
    for _, path, parser in files:
        parser(path)  # a file that is refused undamaged would not reach the parser
    return files


def damaged(data, rng):
    """Bytes with one to four damages."""
    out = bytearray(data)
    text = b"\x00" not in data[:4096]
    for _ in range(rng.choice((1, 1, 2, 4))):
        if not out:
            return bytes(out)
        at = rng.randrange(len(out))
        # beginnings and ends, where formats have their structure, are chosen as often as everything else
        at = rng.choice((at, at, at % min(len(out), 400), len(out) - 1 - at % min(len(out), 400)))
        kind = rng.randrange(8)
        if kind == 0:
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del out[at:]
        elif kind == 2:
            form, size = rng.choice((("<H", 2), ("<I", 4), ("<Q", 8), (">I", 4)))
            out[at : at + size] = struct.pack(form, rng.choice(HUGE) % 2 ** (8 * size))
        elif kind == 3:
            end = at + rng.randrange(1, 200)
            out[at:at] = out[at:end] * rng.choice((1, 3))
        elif kind == 4:
            del out[at : at + rng.randrange(1, 200)]
        elif text:
            word = rng.choice(WORDS).encode("utf-8", "surrogatepass")
            separators = [k for k in (out.find(mark, at) for mark in (b",", b"\n", b"=", b'"', b" ", b">")) if k >= 0]
            start = min(separators, default=at) + 1
            stop = min(
                (k for k in (out.find(mark, start) for mark in (b",", b"\n", b'"', b" ", b"<")) if k >= 0),
                default=start,
            )
            out[start : max(stop, start)] = word
        else:
            out[at : at + 16] = rng.randbytes(16)
    return bytes(out)


def one_input(files, seed, folder):
    """Damage a file by a seed: its kind, path and parser."""
    rng = random.Random(seed)
    name, path, parser = rng.choice(files)
    copy = folder / f"{seed}{path.suffix}"
    if path.is_dir():
        shutil.copytree(path, copy)
        victim = rng.choice([part for part in sorted(copy.rglob("*")) if part.is_file()])
    else:
        shutil.copy(path, copy)
        victim = copy
    if victim.suffix == ".npz" and rng.random() < 0.7:
        with zipfile.ZipFile(path) as archive:
            parts = {part: archive.read(part) for part in archive.namelist()}
        hit = rng.choice(sorted(parts))
        with zipfile.ZipFile(victim, "w", rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))) as archive:
            for part, data in parts.items():
                archive.writestr(part, damaged(data, rng) if part == hit else data)
    elif victim.name == "info.json" and rng.random() < 0.5:
        content = json.loads(victim.read_text())
        del content[rng.choice(sorted(content))]
        victim.write_text(json.dumps(content))
    else:
        victim.write_bytes(damaged(victim.read_bytes(), rng))
    return name, copy, parser


def outcome(path, parser):
    """What becomes of one input: "read", "refused", or what is wrong."""

    def late(_signal, _frame):
        raise TooSlow

    signal.signal(signal.SIGPROF, late)
    Path("/proc/self/clear_refs").write_text("5")
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        parser(path)
        found = "read"
    except (IdentificationError, ControlError, DriverError) as error:
        found = "refused" if path.name in str(error) else f"the file is not named: {error}"
    except TooSlow:
        found = "more than 10 s of CPU"
    except BaseException as error:  # noqa: BLE001 - what the benchmark looks for
        found = f"traceback: {type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    status = Path("/proc/self/status").read_text()
    peak_kb = int(status.split("VmHWM:")[1].split()[0])
    return found if peak_kb < MOST_KB else f"{peak_kb / 1e6:.2f} GB"


def try_all(files, folder, seeds, queue):
    """Try inputs in this process, and report each."""
    for seed in seeds:
        queue.put((seed, None, "begun"))
        name, path, parser = one_input(files, seed, folder)
        queue.put((seed, name, outcome(path, parser)))
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    queue.put(None)


def run(count=COUNT, first=0):
    """Try all inputs, each process until it ends or dies; the number of failures."""
    with tempfile.TemporaryDirectory() as scratch:
        folders = [Path(scratch) / name for name in ("whole", "tried")]
        for folder in folders:
            folder.mkdir()
        return run_of(whole_files(folders[0]), folders[1], count, first)


def run_of(files, folder, count, first):
    """The number of failures of these whole files."""
    context, counts, failures = multiprocessing.get_context("fork"), Counter(), 0
    seed, end = first, first + count
    while seed < end:
        queue = context.SimpleQueue()
        process = context.Process(target=try_all, args=(files, folder, range(seed, end), queue))
        process.start()
        last = seed
        while True:
            while queue.empty() and process.is_alive():
                process.join(0.01)
            if queue.empty():
                failures, seed = failures + 1, last + 1
                print(f"seed {last}: the process died with status {process.exitcode}")
                break
            answer = queue.get()
            if answer is None:
                seed = end
                break
            last, name, found = answer
            if found == "begun":
                continue
            counts[found if found in {"read", "refused"} else "failed"] += 1
            if found not in {"read", "refused"}:
                failures += 1
                print(f"seed {last}, {name}: {found[:300]}")
        process.join()
    print(f"{count} inputs: {counts['read']} read, {counts['refused']} refused, {failures} failed (0 allowed)")
    return failures


if __name__ == "__main__":
    given = [int(word) for word in sys.argv[1:]]
    sys.exit(1 if run(*given) else 0)
