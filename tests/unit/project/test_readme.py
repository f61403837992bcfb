"""The README's examples: its three uses run as they stand, and no command in it names an option that is not there."""

import contextlib
import re
import shlex
from pathlib import Path

import click
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from armload_controller.cli.main import app
from armload_controller.config.robot import load_robot
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance

README = Path(__file__).resolve().parents[3] / "README.md"


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def commands():
    """Words of every `armload` command."""
    text = "\n".join(blocks("console")).replace("\\\n", " ")
    lines = [line.removeprefix("$ ").split("  #")[0] for line in text.splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith("armload ")]


def command(*beginning):
    """The one command that begins so."""
    found = [words for words in commands() if tuple(words[: len(beginning)]) == beginning]
    assert found, f"the README has no `armload {' '.join(beginning)}`"
    return found[0]


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder as a reader has it: er50 with excitations of seconds in place of minutes, and its payload identified."""
    folder = tmp_path_factory.mktemp("desk")
    robot = load_robot("er50")
    offset = np.array([0.0, 0.3, 0.6, 0.0, 0.3, 0.0])
    text = robot.text
    for seed, role in enumerate(("identification", "validation")):
        swing = 0.12 * np.random.default_rng(seed).choice([-1.0, 1.0], (2, 6, 2)) / np.array([1.0, 2.0])
        write_excitation(folder / f"{role}.toml", Excitation(FourierTrajectory(0.5, offset, *swing), 2))
        text = re.sub(rf'^{role} = ".*"$', f'{role} = "{role}.toml"', text, flags=re.MULTILINE)
    (folder / "short.toml").write_text(text)
    body = robot.simulation.payload("paper")
    values = np.stack([body.values, body.values], axis=1)
    known, noise = np.ones(10, dtype=bool), np.ones(6)
    write_payload(
        folder / "payload.toml", PayloadResult("flange", body, known, values, noise, noise, Provenance("0", "0", {}))
    )
    return folder


def run(words, desk):
    """A README command in that folder, on the quick robot."""
    quick = [str(desk / "short.toml") if word == "er50" else word for word in words]
    with contextlib.chdir(desk):
        result = CliRunner().invoke(app, quick, env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output + str(result.exception)
    return result.output


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_every_command_takes_the_options_it_is_shown_with(words):
    command, words = typer.main.get_command(app), list(words)
    while isinstance(command, click.Group):
        command = command.commands[words.pop(0)]
    command.make_context("armload", words).close()


def test_commission_as_shown(desk):
    printed = run(command("commission", "er50", "--output"), desk)
    assert "report" in printed
    assert (desk / "runs/today/payload.toml").is_file()


def test_feed_forward_as_shown(desk):
    assert "less" in run(command("feedforward", "er50"), desk)
    assert (desk / "feedforward.svg").is_file()


def test_a_loop_of_ones_own_as_shown(desk):
    (example,) = blocks("python")
    names = {}
    with contextlib.chdir(desk):
        exec(compile(example, "README.md", "exec"), names)
    assert names["torque_nm"].shape == (6,)
    assert not names["feedforward"].torque_nm(np.zeros(6), np.zeros(6), np.zeros(6)).any()


def test_c_export_as_shown(desk):
    run(command("export", "payload.toml"), desk)
    assert {file.suffix for file in (desk / "export").iterdir()} == {".c", ".h"}
