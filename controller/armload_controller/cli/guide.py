"""`armload` without a command, at a terminal: a choice of four tasks, each translated to a command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

from armload_controller.cli.argument_names import as_options

Ask = Callable[[str], str]
"""Shows a question, returns the answer."""
Say = Callable[[str], None]
_Found = TypeVar("_Found")

CHOICES: Final = (
    "try it: commission a simulated arm; nothing real moves (a minute)",
    "identify a payload from recordings that you have",
    "set up your own arm, from its URDF or by answering questions",
    "commission an arm with an existing robot file",
)


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
    from armload_controller.config.robot import load_robot

    robot, _ = _accepted(ask, say, _robot_question(shipped), load_robot)
    return ["commission", robot, "--output", ask("Folder for the recordings [runs/today]: ").strip() or "runs/today"]


def _identify(ask: Ask, say: Say, shipped: tuple[str, ...]) -> list[str]:
    """Ask for an arm and two recordings, the empty run first; each is read when it is given."""
    from armload_controller.cli.given_arm import given_arm
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.identification_errors import RecordingError
    from armload_identification.pipeline.recording_survey import pair_mismatch
    from armload_identification.recording.recording import Recording

    def run_of(path: str) -> Recording:
        if not path:
            raise RecordingError("nothing was typed: the path of a recording is required, or Ctrl-C to leave")
        return read_of(arm, Path(path))

    def loaded_run(path: str) -> Recording:
        recording = run_of(path)
        problem = pair_mismatch(recording, empty)
        if problem is not None:
            raise RecordingError(problem)
        return recording

    robot, links = _accepted(
        ask, say, _robot_question(shipped, " or URDF"), lambda name: _links(ask, say, name, given_arm)
    )
    arm = given_arm(robot, links.get("--base"), links.get("--flange"))
    unloaded, empty = _accepted(ask, say, "Recording without the payload: ", run_of)
    loaded, _ = _accepted(ask, say, "Recording of the same motion with it: ", loaded_run)
    files = ["--loaded", loaded, "--unloaded", unloaded, "--output", "payload.toml", "--report", "report.html"]
    return ["identify", robot, *_words(links), *files]


def _init(ask: Ask, say: Say) -> list[str]:
    """Ask for a URDF, if any, and for a file that does not exist yet."""
    from armload_controller.config.chain_from_urdf import read_urdf_arm

    urdf, links = _accepted(
        ask,
        say,
        "URDF of the arm; empty to answer questions instead: ",
        lambda path: _links(ask, say, path, read_urdf_arm) if path else {},
    )
    while True:
        output = ask("Robot file to write [my_arm.toml]: ").strip() or "my_arm.toml"
        if not Path(output).exists():
            break
        say(f"  {output} exists and is not overwritten: give another name")
    return ["init", *([urdf, *_words(links)] if urdf else []), "--output", output]


def _links(ask: Ask, say: Say, arm: str, read: Callable[[str, str | None, str | None], object]) -> dict[str, str]:
    """Base and flange, asked for if the file leaves a choice; two empty answers mean another file."""
    from armload_controller.config.urdf_tree import is_urdf
    from armload_controller.control_errors import ConfigurationError

    links: dict[str, str] = {}
    while True:
        try:
            read(arm, links.get("--base"), links.get("--flange"))
        except ConfigurationError as error:
            if not is_urdf(Path(arm)):
                raise
            say(f"  {as_options(str(error))}")
            base = ask("--base, the first link of the arm; empty for the root: ").strip()
            flange = ask("--flange, the last link of the arm; empty for another file: ").strip()
            links = {name: link for name, link in (("--base", base), ("--flange", flange)) if link}
            if not links:
                raise
        else:
            return links


def _words(links: dict[str, str]) -> list[str]:
    """Options as words of a command."""
    return [word for option in links.items() for word in option]


def _robot_question(shipped: tuple[str, ...], also: str = "") -> str:
    """Asks for an arm."""
    return f"The arm: {', '.join(shipped)}, or the path of its TOML{also}: "


def _accepted(ask: Ask, say: Say, question: str, check: Callable[[str], _Found]) -> tuple[str, _Found]:
    """The first path that passes a check, and what that found; the reason is shown for every other."""
    from armload_controller.control_errors import ControlError
    from armload_identification.identification_errors import IdentificationError

    while True:
        answer = _path(ask(question))
        try:
            return answer, check(answer)
        except (ControlError, IdentificationError) as error:
            say(f"  {as_options(str(error))}")


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
