"""`armload` without a command, at a terminal: a choice of four tasks, each translated to a command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
    guide = _Guide(ask, say, shipped)
    while True:
        match ask("1 to 4, or q to leave; `armload --help` lists all commands: ").strip().lower():
            case "q" | "":
                return []
            case "1":
                return ["commission", "er50", "--output", str(_new_folder())]
            case "2":
                return guide.identify()
            case "3":
                return guide.init()
            case "4":
                return guide.commission()
            case answer:
                say(f"  {answer!r}: expected 1, 2, 3, 4 or q")


@dataclass(frozen=True)
class _Guide:
    """Questions whose answers become the words of a command; each answer is checked when it is given."""

    ask: Ask
    say: Say
    shipped: tuple[str, ...]

    def commission(self) -> list[str]:
        """Ask for an arm with a robot file, and a folder."""
        from armload_controller.config.robot import load_robot

        robot, _ = self._accepted(self._robot_question(), load_robot)
        folder = self.ask("Folder for the recordings [runs/today]: ").strip() or "runs/today"
        return ["commission", robot, "--output", folder]

    def identify(self) -> list[str]:
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

        robot, links = self._accepted(self._robot_question(" or URDF"), lambda name: self._links(name, given_arm))
        arm = given_arm(robot, links.get("--base"), links.get("--flange"))
        unloaded, empty = self._accepted("Recording without the payload: ", run_of)
        loaded, _ = self._accepted("Recording of the same motion with it: ", loaded_run)
        files = ["--loaded", loaded, "--unloaded", unloaded, "--output", "payload.toml", "--report", "report.html"]
        return ["identify", robot, *_words(links), *files]

    def init(self) -> list[str]:
        """Ask for a URDF, if any, and for a file that does not exist yet."""
        from armload_controller.config.chain_from_urdf import read_urdf_arm

        question = "URDF of the arm; empty to answer questions instead: "
        urdf, links = self._accepted(question, lambda path: self._links(path, read_urdf_arm) if path else {})
        while True:
            output = self.ask("Robot file to write [my_arm.toml]: ").strip() or "my_arm.toml"
            if not Path(output).exists():
                return ["init", *([urdf, *_words(links)] if urdf else []), "--output", output]
            self.say(f"  {output} exists and is not overwritten: give another name")

    def _links(self, arm: str, read: Callable[[str, str | None, str | None], object]) -> dict[str, str]:
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
                self.say(f"  {as_options(str(error))}")
                base = self.ask("--base, the first link of the arm; empty for the root: ").strip()
                flange = self.ask("--flange, the last link of the arm; empty for another file: ").strip()
                links = {name: link for name, link in (("--base", base), ("--flange", flange)) if link}
                if not links:
                    raise
            else:
                return links

    def _robot_question(self, also: str = "") -> str:
        """Asks for an arm."""
        return f"The arm: {', '.join(self.shipped)}, or the path of its TOML{also}: "

    def _accepted(self, question: str, check: Callable[[str], _Found]) -> tuple[str, _Found]:
        """The first path that passes a check, and what that found; the reason is shown for every other."""
        from armload_controller.control_errors import ControlError
        from armload_identification.identification_errors import IdentificationError

        while True:
            answer = _path(self.ask(question))
            try:
                return answer, check(answer)
            except (ControlError, IdentificationError) as error:
                self.say(f"  {as_options(str(error))}")


def _words(links: dict[str, str]) -> list[str]:
    """Options as words of a command."""
    return [word for option in links.items() for word in option]


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
