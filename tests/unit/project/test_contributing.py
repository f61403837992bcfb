"""CONTRIBUTING.md and the pre-commit hooks agree with the project."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "CONTRIBUTING.md"
ROOMS = (
    "",
    "controller/armload_controller",
    "drivers/armload_drivers",
    "identification/armload_identification",
)
"""Folders to which the page's paths are relative."""

if not PAGE.is_file():
    pytest.skip("not a checkout: the page is not installed", allow_module_level=True)


def test_every_file_and_folder_it_names_is_there():
    text = PAGE.read_text("utf-8")
    rooms = [ROOT / room for room in ROOMS]
    named = set(re.findall(r"\]\(([\w./-]+)\)", text))
    assert len(named) > 5
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []
    in_rooms = set(re.findall(r"`([\w./-]+/[\w.-]*)`", text)) - named
    assert len(in_rooms) > 10
    assert [path for path in sorted(in_rooms) if not any((room / path).exists() for room in rooms)] == []


def test_every_make_target_it_names_is_there():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text("utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"(?<!install )\bmake ([a-z]+)", PAGE.read_text("utf-8"))) <= targets


def test_the_hooks_run_what_make_lint_runs():
    hooks = re.findall(r"entry: (.*)", (ROOT / ".pre-commit-config.yaml").read_text("utf-8"))
    lint = re.search(r"^lint:.*?\n\n", (ROOT / "Makefile").read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)[0]
    assert [hook.removeprefix(".venv/bin/") for hook in hooks] == re.findall(r"\$\(BIN\)/(.*)", lint)
