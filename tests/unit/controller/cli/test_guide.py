"""`armload` without a command: its questions, the resulting command, and a run at a terminal."""

import os
import pty
import select
import shlex
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.cli.guide import guided_words
from tests.bounded import await_that


def log(path):
    """A recording of four joints of any arm."""
    time_s = np.arange(0.0, 20.0, 0.01)
    position_rad = np.sin(np.outer(time_s, [1.0, 1.3, 1.7, 2.1]))
    names = ["time", *(f"{kind}{i}" for kind in ("position", "effort") for i in range(1, 5))]
    table = np.column_stack([time_s, position_rad, 5.0 * position_rad])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="")


SHIPPED = ("er50", "prbt")
LINKS = "".join(f'<link name="l{i}"/>' for i in range(5))
JOINTS = "".join(
    f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/></joint>' for i in range(4)
)


def answered(*answers):
    """Words of the command, and the output."""
    given, said = iter(answers), []
    return guided_words(lambda question: next(given), said.append, SHIPPED), said


@pytest.fixture
def desk(tmp_path, monkeypatch, recorded_er50):
    monkeypatch.chdir(tmp_path)
    for name, load in (("a b.mcap", "loaded"), ("empty.mcap", "unloaded")):
        (tmp_path / name).symlink_to(recorded_er50 / "runs" / "today" / f"{load}_identification.mcap")
    for file in Path(str(resources.files("armload_configs"))).glob("er50*.toml"):
        shutil.copy(file, tmp_path / file.name.replace("er50.toml", "my.toml"))
    log(tmp_path / "other.csv")
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{LINKS}{JOINTS}</robot>')
    camera = '<link name="c"/><joint name="cj" type="fixed"><parent link="l4"/><child link="c"/></joint>'
    (tmp_path / "fork.urdf").write_text(f'<robot name="arm">{LINKS}{JOINTS}{camera}</robot>')
    return tmp_path


@pytest.mark.parametrize(
    ("answers", "command"),
    [
        (["1"], "commission er50 --output runs/try-1"),
        (
            ["2", "er60", "er50", "none.mcap", "empty.mcap", "'a b.mcap'"],
            "identify er50 --loaded 'a b.mcap' --unloaded empty.mcap --output payload.toml --report report.html",
        ),
        (
            ["2", "fork.urdf", "", "l5", "", "l4", "other.csv", "other.csv"],
            "identify fork.urdf --flange l4 --loaded other.csv --unloaded other.csv --output payload.toml "
            "--report report.html",
        ),
        (["5", "3", "arm.urdf", "my.toml", ""], "init arm.urdf --output my_arm.toml"),
        (["3", "", "new.toml"], "init --output new.toml"),
        (["4", "my.toml", ""], "commission my.toml --output runs/today"),
    ],
)
def test_answers_become_a_command(desk, answers, command, require_accepted):
    words, _ = answered(*answers)
    assert words == shlex.split(command)
    require_accepted(words)


def test_what_cannot_be_is_said_and_asked_again(desk):
    (desk / "broken.urdf").write_text("<robot")
    words = ("2", "er60", "broken.urdf", "", "", "er50", "", "none.mcap", "my.toml", "other.csv", "empty.mcap")
    _, said = answered(*words, "other.csv", "a b.mcap")
    asked_again = [line for line in said if line.startswith("  ") and not line[2].isdigit()]
    reasons = (
        "er60: no such file, and no shipped robot",
        "broken.urdf",
        "broken.urdf",
        "nothing was typed",
        "none.mcap",
        "my.toml",
        "joints",
    )
    assert all(reason in line for reason, line in zip(reasons, asked_again[:7], strict=True)), asked_again
    assert len(asked_again) == 8
    assert answered("q")[0] == []


def test_a_second_try_gets_a_folder_of_its_own(desk):
    (desk / "runs" / "try-1").mkdir(parents=True)
    assert answered("1")[0][-1] == "runs/try-2"


def at_terminal(desk, typed):
    """Output of `armload` at a terminal until it ends, and its exit status."""
    leader, follower = pty.openpty()
    program = "from armload_controller.cli.entry import main; main()"
    shown = []

    def ended():
        if not select.select([leader], [], [], 0.0)[0]:
            return False
        try:
            shown.append(os.read(leader, 4096))
        except OSError:  # the other end of the terminal is closed
            return True
        return False

    with subprocess.Popen(
        [sys.executable, "-c", program], cwd=desk, stdin=follower, stdout=follower, stderr=follower
    ) as process:
        try:
            os.close(follower)
            os.write(leader, typed)
            await_that(ended, "the program ends", 60.0)
        finally:
            process.kill()
            os.close(leader)
        return b"".join(shown).decode(), process.wait()


@pytest.mark.long
def test_at_a_terminal_it_is_done_and_the_command_is_shown(desk):
    shown, status = at_terminal(desk, b"3\narm.urdf\nnew.toml\n2.5\n")
    assert "j1: a greatest speed of 1 rad/s" in shown
    assert "the same as: armload init arm.urdf --output new.toml" in shown.replace("\r\n", " ")
    assert (status, (desk / "new.toml").is_file()) == (0, True)


def test_an_end_of_answers_ends_it(desk):
    shown, status = at_terminal(desk, b"3\n\x04")
    assert "end of input" in shown
    assert status == 1


def test_without_a_terminal_it_is_the_help(armload):
    result = armload()
    assert result.exit_code == 2
    assert "commission" in result.output
