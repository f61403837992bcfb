"""The exported component in LinuxCNC's own realtime layer: built by halcompile, loaded by halrun, in a thread of 1 ms.

The timing seen by a userspace program depends on the machine's load, so it waits, with a timeout, for expected values.
No times are asserted; those measured by LinuxCNC are printed.
"""

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_controller.export.body_parameters import PARAMETERS
from armload_controller.export.hal import export_hal
from armload_controller.feedforward.body_torque import LoadFriction
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_identification.model.payload import InertialParameters

MODULES = Path("/usr/lib/linuxcnc/modules")
SESSION = Path(__file__).parents[3] / "hal_session.py"
UNIT = "armload-er50.0"
TOLERANCE_NM = 1e-12
LOCK = Path(tempfile.gettempdir()) / "armload-hal.lock"
NOBODY = 65534
"""User id under which LinuxCNC runs realtime code instead of root."""

pytestmark = [
    pytest.mark.skipif(shutil.which("halcompile") is None, reason="no linuxcnc-uspace-dev on this machine"),
    pytest.mark.skipif(os.geteuid() != 0, reason="halcompile --install writes where only root may"),
]


@pytest.fixture(scope="module")
def installed(calibrated, tmp_path_factory):
    """The folder with the export; the component stays installed until the tests end."""
    # a machine has only one HAL and one folder of modules: other workers wait
    with LOCK.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield from install(calibrated, tmp_path_factory.mktemp("hal"))


def install(subject, folder):
    for name, text in export_hal(subject).items():
        (folder / name).write_text(text)
    built = run(["halcompile", "--install", "armload_er50.comp"], folder)
    assert "warning" not in built
    yield folder
    (MODULES / "armload_er50.so").unlink()


@pytest.fixture(scope="module")
def halrun(installed):
    """Run a HAL file with steps of `hal_session`; returns their results and the output."""
    socket = Path(tempfile.mkdtemp(prefix="hal"))
    socket.chmod(0o777)
    environment = os.environ | {"RTAPI_UID": str(NOBODY), "RTAPI_FIFO_PATH": str(socket / "fifo")}

    def halrun(lines, steps, pins=()):
        (installed / "steps.json").write_text(json.dumps(steps))
        (installed / "results.json").unlink(missing_ok=True)
        name = "lcec" if pins else "hal_session"
        words = [SESSION, installed / "steps.json", installed / "results.json", *pins]
        session = [f"loadusr -Wn {name} /usr/bin/python3 {' '.join(map(str, words))}"]
        before, after = lines
        (installed / "run.hal").write_text("\n".join([*before, *session, *after, f"waitusr {name}"]) + "\n")
        try:
            printed = run(["halrun", "-f", "run.hal"], installed, environment)
        finally:
            subprocess.run(["halrun", "-U"], env=environment, capture_output=True, timeout=60, check=False)
        return json.loads((installed / "results.json").read_text()), printed

    yield halrun
    shutil.rmtree(socket)


def run(command, folder, environment=None):
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def pins_of(symbol, values):
    return {f"{UNIT}.{symbol}-{i}": float(value) for i, value in enumerate(values)}


def at_state(state):
    return pins_of("q", state[0]) | pins_of("dq", state[1]) | pins_of("ddq", state[2])


def payload_pins(body):
    inertia = body.inertia_about_com
    elements = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    values = (body.mass_kg, *body.center_of_mass_m, *elements)
    names = (name.replace("_", "-") for name, _, _ in PARAMETERS)
    return {f"{UNIT}.{name}": float(value) for name, value in zip(names, values, strict=True)}


OTHER = InertialParameters.from_center_of_mass(
    6.0, [0.05, -0.1, 0.2], [[0.05, 0.002, -0.003], [0.002, 0.06, 0.001], [-0.003, 0.001, 0.03]]
)
IMPOSSIBLE = InertialParameters.from_center_of_mass(6.0, [0.0, 0.0, 0.0], np.diag([0.01, 0.01, 0.05]))


def taken_over(pins):
    """The step that sets a new payload, until the component begins to use it."""
    return {"set": pins | {f"{UNIT}.set-payload": 1}, "until": {f"{UNIT}.set-payload": 0}}


@pytest.mark.long
def test_in_a_thread_of_1_ms_its_torque_is_pythons(calibrated, halrun):
    """The payload's torque and its friction in the gears, which is zero at rest."""
    bodies = calibrated.payload.model, OTHER
    feedforward, other = (PayloadFeedforward(calibrated.chain, body) for body in bodies)
    friction = LoadFriction(calibrated.chain, calibrated.calibration.body)
    states = np.random.default_rng(2).uniform(-2.0, 2.0, (30, 3, 6))
    still = states[0] * np.array([[1.0], [0.0], [0.0]])

    def torque(one, state, share=1.0):
        payload_nm = one.torque_nm(*state).copy()
        return pins_of("tau", share * (payload_nm + friction.torque_nm(*state, payload_nm)))

    share, fault, ok = f"{UNIT}.share", f"{UNIT}.fault", f"{UNIT}.payload-ok"
    clocks = f"{UNIT}.compute.time"
    enable, gain, tau = f"{UNIT}.enable", f"{UNIT}.gain", f"{UNIT}.tau-1"
    steps = {
        "loaded": {"set": at_state(still), "until": {ok: 1, share: 0.0, tau: 0.0}},
        "in": {"set": {enable: 1}, "until": torque(feedforward, still) | {share: 1.0}, "watch": [share, clocks]},
        **{f"state {k}": {"set": at_state(s), "until": torque(feedforward, s)} for k, s in enumerate(states)},
        "gain": {"set": at_state(still) | {gain: 0.25}, "until": torque(feedforward, still, 0.25), "watch": [share]},
        "too much": {"set": {gain: 7.0}, "until": {share: 1.0}},
        "limit": {"set": {f"{UNIT}.limit-1": 1.5}, "until": {tau: np.copysign(1.5, torque(feedforward, still)[tau])}},
        "no torque": {"set": {f"{UNIT}.limit-1": float("nan")}, "until": {tau: 0.0}},
        "no limit": {"set": {f"{UNIT}.limit-1": 1e4}, "until": torque(feedforward, still)},
        "impossible": taken_over(payload_pins(IMPOSSIBLE)),
        "refused": {"until": {ok: 0} | torque(feedforward, still)},
        "set": {"set": payload_pins(OTHER), "until": {ok: 0} | torque(feedforward, still)},
        "possible": taken_over({}) | {"watch": [tau]},
        "taken": {"until": {ok: 1} | torque(other, still), "watch": [tau]},
        "no number": {"set": {f"{UNIT}.q-2": float("nan")}, "until": {fault: 1, share: 0.0}, "watch": [tau, share]},
        "a number": taken_over(at_state(still)),
        "for good": {"until": {fault: 1, share: 0.0}},
        "off": {"set": {enable: 0}, "until": {fault: 0}},
        "on": {"set": {enable: 1}, "until": torque(other, still)},
        "out": {"set": {enable: 0}, "until": {share: 0.0, tau: 0.0}, "watch": [share]},
    }
    for step in steps.values():
        step["tolerance"] = TOLERANCE_NM
    before = ["loadrt threads name1=servo-thread period1=1000000", "loadrt armload_er50"]
    before += [f"addf {UNIT}.compute servo-thread", "start"]
    results = halrun((before, []), list(steps.values()))[0]
    results = dict(zip(steps, results, strict=True))
    for name, step in steps.items():
        for pin, value in step["until"].items():
            assert abs(results[name]["found"][pin] - value) <= TOLERANCE_NM, (name, pin)
    for name, ends in (("in", (0.0, 1.0)), ("gain", (1.0, 0.25)), ("no number", (1.0, 0.0)), ("out", (1.0, 0.0))):
        seen = np.array([ends[0], *results[name]["seen"][share], ends[1]])
        assert len(np.unique(seen)) > 4, f"{name}: no ramp"
        assert (np.diff(seen) * (ends[1] - ends[0]) >= 0.0).all(), f"{name}: not one way"
    changed = np.array([*results["possible"]["seen"][tau], *results["taken"]["seen"][tau]])
    assert len(np.unique(changed)) > 10, "a step"
    fading_nm = np.abs([other.torque_nm(*still)[1], *results["no number"]["seen"][tau]])
    assert (np.diff(fading_nm) <= TOLERANCE_NM).all(), "torque of no number"
    taken = np.array(results["in"]["seen"][clocks])
    mhz = float(re.search(r"cpu MHz\s*: (\S+)", Path("/proc/cpuinfo").read_text())[1])
    sys.stdout.write(
        f"one call in LinuxCNC's thread: {np.median(taken):.0f} clocks, {np.median(taken) / mhz * 1e3:.0f} ns at "
        f"{mhz:.0f} MHz; 9 of 10 below {np.percentile(taken, 90) / mhz * 1e3:.0f} ns\n"
    )


@pytest.mark.long
def test_the_torque_is_that_of_a_lag_ago(calibrated, halrun):
    """The lag is half a period, when a sine has the opposite sign: a unit without lag and with negated input agrees.

    A third unit, without lag, gives the torque of this cycle's square wave. LinuxCNC's sine is accurate to 1e-6; an
    error of one cycle would be 1 N m, and 2 N m with the square wave.
    """
    units = late, _, square = [f"armload-er50.{i}" for i in range(3)]
    before = ["loadrt threads name1=servo-thread period1=1000000", "loadrt armload_er50 count=3", "loadrt siggen"]
    before += [f"loadrt {module} count=2" for module in ("sum2", "abs", "minmax")]
    functions = [f"{unit}.compute" for unit in units] + [
        f"{f}.{i}" for i in range(2) for f in ("sum2", "abs", "minmax")
    ]
    before += [f"addf {function} servo-thread" for function in ("siggen.0.update", *functions)]
    before += [f"net sine siggen.0.sine => {units[0]}.q-1 {units[1]}.q-1", "setp siggen.0.frequency 10"]
    before += [f"setp {late}.lag 0.05", f"setp {units[1]}.position-unit -1"]
    before += [f"net {i} {unit}.tau-1 => sum2.0.in{i}" for i, unit in enumerate(units[:2])] + ["setp sum2.0.gain1 -1"]
    ends = np.zeros((2, 3, 6))
    ends[:, 0, 1] = 1.0, -1.0
    feedforward = PayloadFeedforward(calibrated.chain, calibrated.payload.model)
    high, low = (float(feedforward.torque_nm(*state)[1]) for state in ends)
    before += [f"net square siggen.0.square => {square}.q-1 sum2.1.in1", f"net 2 {square}.tau-1 => sum2.1.in0"]
    before += [f"setp sum2.1.gain0 {2.0 / (high - low)!r}", "setp sum2.1.gain1 -1"]
    before += [f"setp sum2.1.offset {-(high + low) / (high - low)!r}"]
    for i in range(2):
        before += [f"net difference-{i} sum2.{i}.out => abs.{i}.in", f"net size-{i} abs.{i}.out => minmax.{i}.in"]
    before += [f"setp {unit}.enable 1" for unit in units] + ["start"]
    off = {f"minmax.{i}.max": 0.0 for i in range(2)}
    steps = [
        {"until": {f"{unit}.share": 1.0 for unit in units}},
        {"set": {f"minmax.{i}.reset": 1 for i in range(2)}, "until": off, "tolerance": 1e-4},
        {"set": {f"minmax.{i}.reset": 0 for i in range(2)}, "until": {"siggen.0.sine": 1.0}, "tolerance": 0.1},
        {"until": {"siggen.0.sine": -1.0}, "tolerance": 0.1},
        {"until": {"siggen.0.sine": 1.0}, "tolerance": 0.1},
        {"until": off, "tolerance": 1e-4},
    ]
    results = halrun((before, []), steps)[0]
    assert abs(results[-2]["found"]["siggen.0.sine"] - 1.0) <= 0.1
    assert max(results[-1]["found"].values()) <= 1e-4


@pytest.mark.long
def test_the_wiring_reaches_the_drives_before_the_fieldbus_writes(calibrated, installed, halrun):
    """LinuxCNC's own motion controller before it, and a component with lcec's pins after it."""
    file = (installed / "armload_er50.hal").read_text()
    pins = re.findall(r"lcec\.\S+", "\n".join(line for line in file.splitlines() if line.startswith("net")))
    assert pins == [f"lcec.0.{joint}.torque-offset" for joint in calibrated.joint_names]
    motion = ["tpmod", "homemod", "trivkins coordinates=XYZABC", "motmod servo_period_nsec=1000000 num_joints=6"]
    before = [f"loadrt {module}" for module in motion] + ["loadrt conv_float_s32 names=the-last"]
    before += ["addf motion-controller servo-thread", "addf the-last servo-thread", "start"]
    after = [
        "source armload_er50.hal",
        f"unlinkp {UNIT}.enable",
        f"setp {UNIT}.enable 1",
        "show thread",
        "show pin lcec",
    ]
    torque_nm = PayloadFeedforward(calibrated.chain, calibrated.payload.model).torque_nm(*np.zeros((3, 6)))
    offsets = np.rint(calibrated.permille_per_nm @ torque_nm)
    assert np.abs(offsets).max() >= 5
    until = {pin: float(offset) for pin, offset in zip(pins, offsets, strict=True)}
    (found,), printed = halrun((before, after), [{"until": until | {f"{UNIT}.share": 1.0}}], pins)
    assert found["found"] == until | {f"{UNIT}.share": 1.0}
    order = re.findall(r"^\s+\d+ (\S+)$", printed, re.MULTILINE)
    assert order == ["motion-controller", f"{UNIT}.compute", "the-last"]


def test_names_from_files_break_nothing(make_subject, tmp_path):
    subject = make_subject("er50")
    limits = replace(subject.limits, joint_names=("*/", ";;", '"""', "\u00e4", "a\nb", "\\"))
    subject = replace(subject, robot='7 Axis*/ "\u00c4"\\', payload_file='a*/b"\\\n#error.toml', limits=limits)
    texts = export_hal(subject)
    name = next(file for file in texts if file.endswith(".comp"))
    (tmp_path / name).write_text(texts[name])
    assert "warning" not in run(["halcompile", "--compile", name], tmp_path)
