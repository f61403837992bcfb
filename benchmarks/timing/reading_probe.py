"""Reads a file in one way, in a separate process that prints its CPU time and memory as JSON."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

import orjson
import zstandard
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader

from armload_identification.recording.file_reading import read_recording_file
from benchmarks.timing.peak_memory import peak_bytes

WATCHED, CALIBRATION = "er50", "arm.calibration.toml"
_RECORD = struct.Struct("<BQ")


def probe(way: str, path: Path) -> dict[str, float]:
    """Read a file in a fresh process.

    Args:
        way: One of "bare", "library", "armload", "watch".
        path: The recording.

    Returns:
        "cpu_s" without the process's start-up, and "peak_mb" of memory.
    """
    command = [sys.executable, "-m", "benchmarks.timing.reading_probe", way, str(path)]
    figures: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return figures


def bare(path: Path) -> None:
    """Unpack every chunk, parse every message, keep nothing."""
    unpacker = zstandard.ZstdDecompressor()
    with path.open("rb") as file:
        file.read(8)
        while len(header := file.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(header)
            content = file.read(length)
            if opcode != Opcode.CHUNK:
                continue
            name = int.from_bytes(content[28:32], "little")
            records = unpacker.decompress(content[32 + name + 8 :])
            at = 0
            while at < len(records):
                kind, size = _RECORD.unpack_from(records, at)
                at += _RECORD.size + size
                if kind == Opcode.MESSAGE:
                    orjson.loads(records[at - size + 22 : at])


def library(path: Path) -> None:
    """Iterate over the records with the mcap library."""
    with path.open("rb") as file:
        for _ in StreamReader(file).records:
            pass


def watch(path: Path) -> Callable[[], object]:
    """Estimation of what the arm carries, as by `armload watch`, with the calibration in the recording's folder.

    Loading the program and the calibration is start-up, as for the others.
    """
    from armload_controller.analysis.payload_watch import PayloadWatch
    from armload_controller.config.robot import load_robot

    watching = PayloadWatch(load_robot(WATCHED), path.with_name(CALIBRATION))
    return lambda: deque(watching.file(path), maxlen=0)


if __name__ == "__main__":
    way, recording = sys.argv[1], Path(sys.argv[2])
    ways: dict[str, Callable[[Path], object]] = {"bare": bare, "library": library, "armload": read_recording_file}
    measured = watch(recording) if way == "watch" else partial(ways[way], recording)
    begun_s = time.process_time()
    measured()
    used_s = time.process_time() - begun_s
    sys.stdout.write(json.dumps({"cpu_s": used_s, "peak_mb": peak_bytes() / 1e6}))
