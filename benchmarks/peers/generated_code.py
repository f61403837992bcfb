"""The exported C and casadi's generated code: the payload's torque of three arms, on the same states.

Both are compiled with the same options into one program, which calls them in alternate rounds; medians of CPU time.
Each generator counts its operations; the library functions (sin, cos) are the same.
Where `arm-none-eabi-gcc` is installed, the size of the code in single precision on a Cortex-M4.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import thread_time
from typing import Final

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.export.c99 import export_c
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.straight_line.arm_functions import any_torque, regressor_of, torque_of
from armload_controller.export.straight_line.expressions import Operations
from armload_controller.export.straight_line.precision import Precision
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_controller.motion.joint_limits import MotionLimits
from armload_core.c_compiler import c_compiler
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from benchmarks.arms import sagging_panda
from benchmarks.peers.peer_environment import PEERS_PYTHON

ROUNDS: Final = 25
STATES: Final = 64  # a power of two
CALLS: Final = 320 * STATES
PYTHON_CALLS: Final = 5_000
CORTEX_M4: Final = ("-Os", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")

_CASADI: Final = "int casadi_torque(const double **arg, double **res, long long *iw, double *w, int mem);"
_CASADI_CALL: Final = "(void)casadi_torque((const double *[]){STATE[t][0], STATE[t][1], STATE[t][2]}, &torque, 0, 0, 0)"
_HARNESS: Final = """\
#include <stdio.h>
#include <time.h>
#include "%(name)s.h"
%(casadi)s

enum { STATES = %(states)d, JOINTS = %(joints)d, ROUNDS = %(rounds)d };
static const double STATE[STATES][3][JOINTS] = {%(numbers)s};
static double found[JOINTS], sum;
static %(name)s_state state;

%(functions)s
int main(void)
{
    double (*const timed[])(void) = {%(timed)s};
    int r, k, j;

    %(name)s_init(&state);
    for (r = 0; r < ROUNDS; r++) {
        for (k = 0; k < (int)(sizeof timed / sizeof *timed); k++) {
            printf("%%.9e ", timed[k]());
        }
    }
    for (k = 0; k < (int)(sizeof timed / sizeof *timed); k++) {
        timed[k]();
        for (j = 0; j < JOINTS; j++) {
            printf("%%.17g ", found[j]);
        }
    }
    return sum != sum;
}
"""
_TIMED: Final = """\
static double %(label)s(void)
{
    double *torque = found;
    const clock_t started = clock();
    long i;

    for (i = 0; i < %(calls)dL; i++) {
        const int t = (int)(i & (STATES - 1));
        %(call)s;
        sum += torque[0];
    }
    return (double)(clock() - started) / CLOCKS_PER_SEC / %(calls)d;
}
"""


@dataclass(frozen=True)
class Measured:
    """One function for the torque.

    Attributes:
        seconds: CPU time of a call.
        torque_nm: (n,) at the last state.
    """

    seconds: float
    torque_nm: FloatArray


def run() -> None:
    """Print the tables."""
    compiler = c_compiler()
    if compiler is None:
        print("Generated C: skipped, there is no C compiler on this machine")
        return
    if not PEERS_PYTHON.exists():
        print(f"\ncasadi's code: not measured, there is no {PEERS_PYTHON}; `make peers` installs it")
    for subject in (_shipped("er50"), _shipped("prbt"), _panda()):
        with tempfile.TemporaryDirectory() as folder:
            _compare(subject, Path(folder), compiler)


def _compare(subject: ExportSubject, folder: Path, compiler: list[str]) -> None:
    """One arm."""
    chain, payload, name = subject.chain, subject.payload.model, f"armload_{subject.identifier}"
    states = np.random.default_rng(0).uniform(-1.5, 1.5, (STATES, 3, chain.n))
    for file, text in export_c(subject).items():
        (folder / file).write_text(text)
    casadi = _casadi(subject, folder / "casadi_torque.c", Precision.DOUBLE)
    calls = {
        "folded": f"{name}_torque(STATE[t][0], STATE[t][1], STATE[t][2], torque)",
        "given": f"{name}_compute(&state, STATE[t][0], STATE[t][1], STATE[t][2], torque)",
    } | ({} if casadi is None else {"peer": _CASADI_CALL})
    found = _timed(folder, compiler, name, states, calls)
    python = PayloadFeedforward(chain, payload)
    expected = python.torque_nm(*states[-1]).copy()
    print(
        f"\nPayload torque of {subject.robot}, {chain.n} joints, gcc -O2; CPU time, median of {ROUNDS} rounds in turn"
    )
    rows = [
        ("armload export, the payload's numbers folded in", "folded", torque_of(chain, payload).operations),
        ("armload export, any payload, blended", "given", any_torque(chain).operations),
    ]
    if casadi is not None:
        rows.append(("casadi, the payload's numbers folded in", "peer", casadi))
    for title, key, done in rows:
        _row(title, found[key].seconds, found["folded"].seconds, done)
    _row("PayloadFeedforward.torque_nm, called from Python", _seconds(python, states), found["folded"].seconds, None)
    regressor = regressor_of(chain).operations
    print(f"  regressor: {regressor.multiplications} x, {regressor.additions} +: {regressor.total} operations")
    worst_nm = max(float(np.abs(way.torque_nm - expected).max()) for way in found.values())
    print(f"  greatest difference from the core: {worst_nm:.1e} N m")
    _sizes(subject, folder)


def _row(title: str, seconds: float, first_s: float, done: Operations | None) -> None:
    counted = (
        "" if done is None else f"{done.multiplications:5d} x {done.additions:4d} + {done.trigonometric:3d} sin, cos"
    )
    print(f"  {title:48s} {seconds * 1e9:7.0f} ns {seconds / first_s:5.2f} x {counted}")


def _timed(
    folder: Path, compiler: list[str], name: str, states: FloatArray, calls: dict[str, str]
) -> dict[str, Measured]:
    """Each function, in alternate rounds; in separate objects, so that no call is moved out of the loop."""
    fields = {
        "name": name,
        "casadi": _CASADI if "peer" in calls else "",
        "states": STATES,
        "joints": states.shape[2],
        "rounds": ROUNDS,
        "numbers": ", ".join(repr(float(value)) for value in states.ravel()),
        "functions": "\n".join(_TIMED % {"label": k, "call": v, "calls": CALLS} for k, v in calls.items()),
        "timed": ", ".join(calls),
    }
    (folder / "main.c").write_text(_HARNESS % fields)
    sources = ["main.c", f"{name}.c", *(["casadi_torque.c"] if "peer" in calls else [])]
    flags = ["-std=c99", "-O2", "-Wno-missing-braces"]
    subprocess.run([*compiler, *flags, *sources, "-o", "benchmark", "-lm"], cwd=folder, check=True)
    done = subprocess.run([folder / "benchmark"], capture_output=True, text=True, check=True)
    numbers = np.array(done.stdout.split(), dtype=float)
    times = numbers[: ROUNDS * len(calls)].reshape(ROUNDS, len(calls))
    torque = numbers[times.size :].reshape(len(calls), -1)
    return {key: Measured(float(np.median(times[:, k])), torque[k]) for k, key in enumerate(calls)}


def _casadi(subject: ExportSubject, output: Path, precision: Precision) -> Operations | None:
    """Generate casadi's code for the same arm and payload, in its joints' frames; None without casadi."""
    if not PEERS_PYTHON.exists():
        return None
    chain = subject.chain
    turned = np.tile(np.eye(4), (chain.n, 1, 1))
    packed = chain.packed[3 : 3 + 12 * chain.n].reshape(chain.n, 12)
    turned[:, :3, :3], turned[:, :3, 3] = packed[:, :9].reshape(chain.n, 3, 3), packed[:, 9:]
    last = np.eye(4)
    last[:3, :3] = chain.turned_back(chain.n - 1)
    theta = subject.payload.model.transformed(last @ chain.flange).theta
    given = {
        "placement": turned.tolist(),
        "gravity": chain.gravity_m_s2.tolist(),
        "mass": theta[0],
        "moment": theta[1:4].tolist(),
        "inertia": theta[[[4, 7, 8], [7, 5, 9], [8, 9, 6]]].tolist(),
        "real": str(precision),
        "output": str(output),
    }
    script = Path(__file__).with_name("casadi_code.py")
    done = subprocess.run([PEERS_PYTHON, script], input=json.dumps(given), capture_output=True, text=True, check=True)
    return Operations(**json.loads(done.stdout))


def _sizes(subject: ExportSubject, folder: Path) -> None:
    """Print the code size of the torque in single precision on a Cortex-M4."""
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None:
        print("  Cortex-M4: not measured, there is no arm-none-eabi-gcc")
        return
    name = f"armload_{subject.identifier}"
    for file, text in export_c(subject, Precision.SINGLE).items():
        (folder / file).write_text(text)
    torque, everything = (_text_bytes(folder, compiler, f"{name}.c", part) for part in (f"{name}_torque", None))
    line = f"torque {torque} bytes, all functions and constants {everything} bytes"
    if _casadi(subject, folder / "casadi_float.c", Precision.SINGLE) is not None:
        line += f"; casadi's torque {_text_bytes(folder, compiler, 'casadi_float.c', 'casadi_torque')} bytes"
    print(f"  Cortex-M4, {' '.join(CORTEX_M4)}, --float: {line}")


def _text_bytes(folder: Path, compiler: str, source: str, function: str | None) -> int:
    """Bytes of one function, or of all code and constants in flash memory."""
    flags = ["-std=c99", *CORTEX_M4, "-ffunction-sections", "-c", source, "-o", "sized.o"]
    subprocess.run([compiler, *flags], cwd=folder, check=True)
    tool = compiler.removesuffix("gcc") + "size"
    listed = subprocess.run([tool, "-A", "sized.o"], cwd=folder, capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listed.splitlines() if line.startswith((".text", ".rodata"))]
    wanted = [row for row in rows if function is None or row[0].startswith(f".text.{function}")]
    return sum(int(size) for _, size, _ in wanted)


def _seconds(python: PayloadFeedforward, states: FloatArray) -> float:
    """Median CPU time of a call in a Python loop, in s."""
    found = []
    for _ in range(ROUNDS):
        started = thread_time()
        for _ in range(PYTHON_CALLS):
            python.torque_nm(*states[-1])
        found.append((thread_time() - started) / PYTHON_CALLS)
    return median(found)


def _shipped(name: str) -> ExportSubject:
    """A shipped arm with its expected payload, all ten parameters taken as measured."""
    robot = load_robot(name)
    return ExportSubject.of(robot, _measured(robot.payloads.expected, robot.n), "expected_payload", robot.sha256)


def _panda() -> ExportSubject:
    """Seven joints; limits from Franka Emika's robot and interface specifications."""
    limits = MotionLimits(
        joint_names=tuple(f"joint_{i}" for i in range(1, 8)),
        position_min_rad=np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
        position_max_rad=np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
        velocity_max_rad_s=np.array([2.175] * 4 + [2.61] * 3),
        acceleration_max_rad_s2=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
        jerk_max_rad_s3=np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
        following_error_rad=np.full(7, np.inf),
    )
    return ExportSubject(
        robot="panda",
        robot_sha256="",
        chain=sagging_panda.chain(),
        limits=limits,
        torque_max_nm=np.array([87.0] * 4 + [12.0] * 3),
        payload=_measured(sagging_panda.PAYLOAD, 7),
        payload_file="benchmark",
        payload_sha256="",
        armload_version="benchmark",
    )


def _measured(body: InertialParameters, n: int) -> PayloadResult:
    per_joint = np.ones(n)
    return PayloadResult(
        frame="flange",
        model=body,
        determined=np.ones(10, dtype=np.bool_),
        interval_95=np.tile(body.values[:, None], 2),
        residual_rms_nm=per_joint,
        noise_nm=per_joint,
        provenance=Provenance("benchmark", "", {}),
    )


if __name__ == "__main__":
    run()
