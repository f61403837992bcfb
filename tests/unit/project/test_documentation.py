"""The documentation: its code runs, its commands are accepted, and the site builds without a warning."""

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from armload_core.c_compiler import c_compiler
from armload_identification.files.payload_file import parse_payload
from armload_identification.identification_errors import PayloadFileError

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
pytestmark = pytest.mark.skipif(not PAGES, reason="not a checkout: the documentation is not installed")


def blocks(page, language):
    indented = re.findall(rf"^( *)```{language}\n(.*?)^ *```", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    return [re.sub(rf"^{indent}", "", text, flags=re.MULTILINE) for indent, text in indented]


PROGRAMS = [
    pytest.param(page, marks=[pytest.mark.long] * (page.stem == "five-minutes"), id=page.stem) for page in PAGES
]


@pytest.mark.parametrize("page", PROGRAMS)
def test_the_code_of_a_page_runs(page, tmp_path):
    program = "\n".join(blocks(page, "python"))
    run = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert bool(run.stdout) == bool(program)


def test_the_payload_by_hand_is_the_smallest_that_is_read():
    (text,) = blocks(DOCS / "feed-forward-in-a-loop.md", "toml")
    assert parse_payload(text).feedforward_ready
    lines = text.splitlines()
    for line in filter(None, lines):
        with pytest.raises(PayloadFileError):
            parse_payload("\n".join(each for each in lines if each is not line))


@pytest.mark.long
def test_the_loop_in_c_gives_the_torque_of_the_loop_in_python(armload, tmp_path):
    page = DOCS / "feed-forward-in-a-loop.md"
    python = subprocess.run([sys.executable, "-c", *blocks(page, "python")], capture_output=True, text=True, check=True)
    for name, language in (("main.c", "c"), ("payload.toml", "toml")):
        (tmp_path / name).write_text(*blocks(page, language))
    exported = armload("export", "er50", tmp_path / "payload.toml", "--format", "c", "--output", tmp_path / "export")
    assert "robot file" not in exported.output
    (compile_it,) = re.findall(r"^\$ cc (.*)$", page.read_text("utf-8"), flags=re.MULTILINE)
    subprocess.run([*c_compiler(), *compile_it.split()], cwd=tmp_path, check=True)
    printed = subprocess.run([tmp_path / "loop"], capture_output=True, text=True, check=True).stdout
    assert printed == f"{python.stdout.split()[2]} N m on joint 2\n"


COMMANDS = [
    words
    for page in PAGES
    for text in blocks(page, "console")
    for line in text.replace("\\\n", " ").splitlines()
    if (words := shlex.split(line.removeprefix("$ "), comments=True))[:1] == ["armload"]
]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_takes_the_options_it_is_shown_with(words, require_accepted):
    require_accepted(words[1:])


@pytest.mark.long
@pytest.mark.skipif(importlib.util.find_spec("sphinx") is None, reason="the extra docs is not installed")
def test_the_site_builds_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "-q", "-c", DOCS, ROOT, tmp_path]
    built = subprocess.run([*command, "-d", tmp_path / "trees"], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    theory = (tmp_path / "docs" / "theory.html").read_text("utf-8")
    assert theory.count("<math ") > 20
    for page in tmp_path.rglob("*.html"):
        loaded = re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(https?:[^"]*)"', page.read_text("utf-8"))
        assert loaded == [], page
    assert "armload commission" in (tmp_path / "docs" / "reference" / "commands.html").read_text("utf-8")
    index = (tmp_path / "searchindex.js").read_text("utf-8")
    assert all(word in index for word in ("calibr", "excit", "heartbeat"))
