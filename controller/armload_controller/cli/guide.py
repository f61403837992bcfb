"""`armload` without a command, at a terminal: a choice of four tasks, each translated to a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

Ask = Callable[[str], str]
"""Shows a question, returns the answer."""
Say = Callable[[str], None]

CHOICES: Final = (
    "try it: commission a simulated arm; nothing real moves (a minute)",
    "identify a payload from recordings that you have",
    "set up your own arm, from its URDF or by answering questions",
    "commission an arm with an existing robot file",
)
_URDF: Final = ".urdf"


def guided_words(ask: Ask, say: Say, shipped: tuple[str, ...]) -> list[str]:
    """Ask the operator what to do.

    Args:
        ask: Asks a question and returns the answer.
        say: Shows a line.
        shipped: Names of the shipped robots.

    Returns:
        The words of the command; empty if the operator quits.
    """
    say("What do you want to do?")
    for number, choice in enumerate(CHOICES, 1):
        say(f"  {number}  {choice}")
    while True:
        answer = ask("1 to 4, or q to leave; `armload --help` lists all commands: ").strip().lower()
        if answer in {"q", ""}:
            return []
        if answer in {"1", "2", "3", "4"}:
            break
        say(f"  {answer!r}: expected 1, 2, 3, 4 or q")
    if answer == "1":
        return ["commission", "er50", "--output", str(_new_folder())]
    if answer == "2":
        return _identify(ask, say, shipped)
    if answer == "3":
        return _init(ask, say)
    return [
        "commission",
        _robot(ask, say, shipped),
        "--output",
        ask("Folder for the recordings [runs/today]: ").strip() or "runs/today",
    ]


def _identify(ask: Ask, say: Say, shipped: tuple[str, ...]) -> list[str]:
    """Ask for two recordings and an arm."""
    loaded = _existing(ask, say, "Recording with the payload: ")
    unloaded = _existing(ask, say, "Recording of the same motion without it: ")
    arm = _robot(ask, say, shipped, urdf=True)
    words = ["identify"]
    if arm.lower().endswith(_URDF):
        words += ["--urdf", arm, *_links(ask, say, arm)]
    else:
        words.append(arm)
    return [*words, "--loaded", loaded, "--unloaded", unloaded, "--output", "payload.toml", "--report", "report.html"]


def _init(ask: Ask, say: Say) -> list[str]:
    """Ask for a URDF, if any, and for a file that does not exist yet."""
    urdf = _existing(ask, say, "URDF of the arm; empty to answer questions instead: ", optional=True)
    arm = [urdf, *_links(ask, say, urdf)] if urdf else []
    while True:
        output = ask("Robot file to write [my_arm.toml]: ").strip() or "my_arm.toml"
        if not Path(output).exists():
            break
        say(f"  {output} exists and is not overwritten: give another name")
    return ["init", *arm, "--output", output]


def _links(ask: Ask, say: Say, urdf: str) -> list[str]:
    """Ask for base and flange if the URDF leaves a choice."""
    from armload_controller.config.chain_from_urdf import read_urdf_arm
    from armload_controller.control_errors import ConfigurationError

    base = flange = ""
    while True:
        try:
            read_urdf_arm(urdf, base or None, flange or None)
        except ConfigurationError as error:
            say(f"  {error}")
            base = ask("--base, the first link of the arm; empty for the root: ").strip()
            flange = ask("--flange, the last link of the arm; empty for the only end: ").strip()
        else:
            return [*(["--base", base] if base else []), *(["--flange", flange] if flange else [])]


def _robot(ask: Ask, say: Say, shipped: tuple[str, ...], *, urdf: bool = False) -> str:
    """A shipped robot, or a file that exists."""
    also = " or URDF" if urdf else ""
    while True:
        answer = _path(ask(f"The arm: {', '.join(shipped)}, or the path of its TOML{also}: "))
        if answer in shipped or Path(answer).is_file():
            return answer
        say(f"  {answer!r}: no such file and no shipped robot")


def _existing(ask: Ask, say: Say, question: str, *, optional: bool = False) -> str:
    """A file or folder that exists."""
    while True:
        answer = _path(ask(question))
        if (answer and Path(answer).exists()) or (optional and not answer):
            return answer
        say(f"  {answer!r}: no such file or folder")


def _path(answer: str) -> str:
    """A typed path without quotation marks, with ~ expanded."""
    bare = answer.strip().strip("'\"")
    return str(Path(bare).expanduser()) if bare else ""


def _new_folder() -> Path:
    """A folder that does not exist yet."""
    number = 1
    while (folder := Path("runs") / f"try-{number}").exists():
        number += 1
    return folder
