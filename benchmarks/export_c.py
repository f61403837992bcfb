"""The exported C beside the feed-forward called from Python, on the same arm and the same states.

The C is timed by a compiled loop of its own, as a control loop in C calls it; the feed-forward by a loop in Python.
Rounds are interleaved, so that a busy machine is busy for all of them; medians.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import thread_time

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.export.c99 import export_c
from armload_controller.export.subject import ExportSubject
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_identification.model.payload import PayloadResult, Provenance

ROUNDS = 15
C_CALLS = 200_000
PYTHON_CALLS = 5_000
STATES = 64  # a power of two

_HARNESS = """\
#include <stdio.h>
#include <time.h>
#include "armload_er50.h"

enum { STATES = %(states)d };
static const double STATE[STATES][3][ARMLOAD_ER50_JOINTS] = {%(numbers)s};

int main(void)
{
    double torque[ARMLOAD_ER50_JOINTS] = {0.0}, sum = 0.0;
    clock_t started = clock();
    long i;
    int j;

    for (i = 0; i < %(calls)dL; i++) {
        const int t = (int)(i & (STATES - 1));
        armload_er50_torque(STATE[t][0], STATE[t][1], STATE[t][2], torque);
        sum += torque[0];
    }
    printf("%%.9e", (double)(clock() - started) / CLOCKS_PER_SEC / %(calls)d);
    for (j = 0; j < ARMLOAD_ER50_JOINTS; j++) {
        printf(" %%.17g", torque[j]);
    }
    return sum != sum;
}
"""


def run() -> None:
    """Print the table."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("Exported C: skipped, there is no C compiler on this machine")
        return
    subject = _subject()
    states = np.random.default_rng(0).uniform(-1.5, 1.5, (STATES, 3, subject.chain.n))
    last = tuple(states[-1])
    feedforward = PayloadFeedforward(subject.chain, subject.payload.model)
    with tempfile.TemporaryDirectory() as folder:
        program = _compile(Path(folder), compiler, subject, states)
        c_s, object_s = [], []
        for _ in range(ROUNDS):
            done = subprocess.run([program], capture_output=True, text=True, check=True)
            duration, *torque = (float(word) for word in done.stdout.split())
            c_s.append(duration)
            object_s.append(_seconds(lambda: feedforward.torque_nm(*last)))
    error_nm = np.abs(np.array(torque) - feedforward.torque_nm(*last)).max()
    print(f"\nPayload torque, one sample of {subject.chain.n} joints, er50; median of {ROUNDS} rounds")
    rows = {
        "armload export --format c, gcc -O2, called from C": median(c_s),
        "PayloadFeedforward.torque_nm, called from Python": median(object_s),
    }
    for name, seconds in rows.items():
        print(f"  {name:54s} {seconds * 1e6:7.3f} us   {seconds / rows[next(iter(rows))]:5.1f} x")
    print(f"  greatest difference between C and Python: {error_nm:.1e} N m")


def _subject() -> ExportSubject:
    """The er50 with its expected payload, as if all of it had been measured."""
    robot = load_robot("er50")
    body, per_joint = robot.payloads.expected, np.ones(robot.n)
    payload = PayloadResult(
        frame="flange",
        model=body,
        determined=np.ones(10, dtype=np.bool_),
        interval_95=np.tile(body.values[:, None], 2),
        residual_rms_nm=per_joint,
        noise_nm=per_joint,
        provenance=Provenance("benchmark", robot.sha256, {}),
    )
    return ExportSubject.of(robot, payload, "expected_payload", robot.sha256)


def _compile(folder: Path, compiler: str, subject: ExportSubject, states: np.ndarray) -> Path:
    """The harness and the export as a program; in two objects, so that no call is moved out of the loop."""
    for name, text in export_c(subject).items():
        (folder / name).write_text(text)
    numbers = ", ".join(repr(float(value)) for value in states.ravel())
    (folder / "main.c").write_text(_HARNESS % {"states": STATES, "numbers": numbers, "calls": C_CALLS})
    program = folder / "benchmark"
    flags = ["-std=c99", "-O2", "-Wno-missing-braces"]
    subprocess.run([compiler, *flags, "main.c", "armload_er50.c", "-o", program, "-lm"], cwd=folder, check=True)
    return program


def _seconds(call: Callable[[], object]) -> float:
    """Duration of one call in a loop of Python."""
    started = thread_time()
    for _ in range(PYTHON_CALLS):
        call()
    return (thread_time() - started) / PYTHON_CALLS


if __name__ == "__main__":
    run()
