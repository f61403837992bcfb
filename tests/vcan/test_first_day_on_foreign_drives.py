"""The page of the first day, command by command, against drives on another CANopen stack.

They are those of `../shared/tools/canopen-drives`: each motor is alone, without gravity, so the page is followed to the
first motion. That is interrupted by Ctrl-C, by a drive that loses its power, and ends by itself; each time no drive
carries torque afterwards, and the same command starts again. Build the drives first: `canopen-drives --prepare`.
"""

import re
import signal
import subprocess
import time

import pytest

from benchmarks.arms.drafted_arm import drafted_urdf
from tests.first_day import needs_page, page_commands
from tests.foreign_drives import DRIVES, ForeignDrives
from tests.started_programs import armload_before_others

FIRST_NODE, TORQUE_LIMIT_PERMILLE = 3, 2500
SIMULATED = {"1018:1": "0x41524D4C", "1018:2": "0x53494D01"}
FILLED_IN = {"feedback": '"torque"', "max_torque_permille": str(TORQUE_LIMIT_PERMILLE), "has_brake": "true"}
PATIENT = {"cycle_hz": "50.0", "heartbeat_s": "2.0", "max_missing_cycles": "100"}
"""Both sides share the one CPU of the guest."""
ARMLOAD = armload_before_others()
pytestmark = [
    pytest.mark.vcan,
    pytest.mark.skipif(not DRIVES.is_file(), reason="canopen-drives is not beside this checkout"),
    needs_page,
]


@pytest.fixture
def drives(tmp_path):
    """Six of them, whose identity says that nothing real moves."""
    (tmp_path / "arm.urdf").write_text(drafted_urdf())
    presets = [f"{entry}={value}" for entry, value in SIMULATED.items()]
    torques_nm = [float(text) for text in re.findall(r'effort="([^"]+)"', drafted_urdf())]
    for node, torque_nm in enumerate(torques_nm, FIRST_NODE):
        presets.append(f"{node}:6076:0={round(1e6 * torque_nm / TORQUE_LIMIT_PERMILLE)}")
    made = ForeignDrives(tmp_path, f"{FIRST_NODE}-{FIRST_NODE + len(torques_nm) - 1}", presets)
    try:
        yield made
    finally:
        made.close()


def page_command(beginning):
    """The page's first command that begins with these words, for this bus."""
    found = next(words for words in page_commands() if words.startswith(beginning))
    return found.replace("socketcan:can0", "socketcan:vcan0").split()


def follow(folder, beginning, *options, interrupt_after_s=None):
    """Run the page's command to its end, or interrupt it."""
    words = [*ARMLOAD, *page_command(beginning), *options]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as program:
        if interrupt_after_s is not None:
            time.sleep(interrupt_after_s)
            program.send_signal(signal.SIGINT)
        text, _ = program.communicate(timeout=180)
    return program.returncode, text


def move_until(folder, drives, happens):
    """The page's first motion; `happens` is called with the program once all drives carry torque."""
    words = [
        *ARMLOAD,
        *page_command("commission arm.toml --runs unloaded"),
        "--simulated-drives",
        "--yes",
    ]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as program:
        until_s = time.monotonic() + 60.0
        while len(drives.powered()) < 6 and program.poll() is None and time.monotonic() < until_s:
            time.sleep(0.2)
        enabled = len(drives.powered()) == 6
        time.sleep(1.0)
        happens(program)
        text, _ = program.communicate(timeout=400)
    assert enabled, text
    assert program.returncode, text
    assert "slow round" in text
    assert "Motion stopped" in text, text
    assert drives.powered() == [], text
    return text


def test_the_page_is_followed_to_the_first_motion(drives, tmp_path):
    status, text = follow(tmp_path, "drives scan")
    assert (status, text.count("canopen-drives")) == (0, 6), text

    status, text = follow(tmp_path, "init", "--restarts", "1")
    assert status == 0, text
    file = tmp_path / "arm.toml"
    content = file.read_text("utf-8")
    for key, value in FILLED_IN.items():
        assert text.count(f".drive.{key}") == 6, "the list names what to fill in"
        content = re.sub(rf'^{key} = "FILL IN"', f"{key} = {value}", content, flags=re.MULTILINE)
    assert '"FILL IN"' not in content.split("[robot]")[1]
    for key, value in PATIENT.items():
        content = re.sub(rf"^{key} = [\d.]+", f"{key} = {value}", content, flags=re.MULTILINE)
    file.write_text(content)

    status, text = follow(tmp_path, "drives check")
    assert status == 0, text
    _, text = follow(tmp_path, "drives show", interrupt_after_s=8.0)
    assert text.count("+0.00000") >= 6, text

    text = move_until(tmp_path, drives, lambda program: program.send_signal(signal.SIGINT))
    assert "the operator" in text.lower() or "stop was requested" in text.lower(), text
    text = move_until(tmp_path, drives, lambda program: drives.order(f"reboot {FIRST_NODE + 2}"))
    assert f"node {FIRST_NODE + 2}" in text, text
    move_until(tmp_path, drives, lambda program: None)
    assert list((tmp_path / "runs" / "first").glob("*.mcap")), "what was recorded is kept"
