"""Identifies once on one core, and prints time and memory as JSON.

python -m benchmarks.accuracy.speed_probe LOADED UNLOADED
"""

import os
import time

_BEGUN_S = time.perf_counter()
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

import json  # noqa: E402 - one core and one thread for the imports too
import resource  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402

from armload_controller.config.robot import load_robot  # noqa: E402
from armload_identification.pipeline.payload_identification import identify_runs  # noqa: E402
from armload_identification.recording.file_reading import read_recording_file  # noqa: E402
from benchmarks.timing.peak_memory import peak_bytes  # noqa: E402


def main() -> None:
    """Identify from the two files, and print the measurements."""
    robot = load_robot("er50")
    loaded, unloaded = (read_recording_file(Path(name)) for name in sys.argv[1:3])
    read_s = time.perf_counter()
    result = identify_runs(loaded, unloaded, robot.chain, robot.drives.transmission)
    used = resource.getrusage(resource.RUSAGE_SELF)
    figures = {
        "wall_s": time.perf_counter() - _BEGUN_S,
        "cpu_s": used.ru_utime + used.ru_stime,
        "identify_s": time.perf_counter() - read_s,
        "largest_bytes": peak_bytes(),
        "mass_kg": result.parameters.mass_kg,
    }
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
