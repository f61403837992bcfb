"""What an integrator reaches who follows nothing but armload's messages, with every device description of a folder.

    python -m benchmarks.descriptions FOLDER [FOLDER ...]

For each EDS or DCF file: an arm whose drives have exactly the objects of the file (`armload simulate --description`)
is brought up (`armload drives check`) and, if nothing is wrong, moved. What a message says to set, `key = value`, is
set in the robot's file, and all is repeated, until the arm moves or a message gives nothing new to set. The loop knows
no message: it searches their text for keys of the robot's file. Everything runs in lockstep, on the shipped arm `er50`.

An edit is one change of the file, after one check, whatever number of keys it has.
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib import resources
from itertools import groupby
from pathlib import Path

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.tables.drive_tables import BusTable, DriveTable
from armload_controller.control_errors import ControlError
from armload_drivers.bring_up.description_file import read_description
from armload_drivers.bring_up.drive_check import Verdict, check
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.eds_parser import DeviceDescription
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import DriverError
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.ideal_plant import IdealPlant

MOST_EDITS = 8
"""The loop ends after as many edits: advice that goes round in circles."""
ALLOWED_EDITS = 3
_ARM = "er50"
_CYCLES = 25
_SPEED_RAD_S = 0.05
_SUFFIXES = {".eds", ".dcf"}
_VALUE = r'(true|false|"[^"]*"|\[[^\]]*\]|\{[^}]*\}|-?(?:0x[0-9A-Fa-f]+|[0-9.]+(?:e-?[0-9]+)?)(?=[^0-9A-Za-z]|$))'


@dataclass(frozen=True)
class Outcome:
    """How one file ended.

    Attributes:
        file: Name of the file.
        maker: The maker, as the file states it.
        moves: Whether the arm has moved and come to rest.
        edits: Keys of each edit.
        last: The last message; empty if the arm moves.
    """

    file: str
    maker: str
    moves: bool
    edits: tuple[tuple[str, ...], ...]
    last: str

    @property
    def counts(self) -> bool:
        """Whether it moves within the permitted edits."""
        return self.moves and len(self.edits) <= ALLOWED_EDITS


def settings_in(message: str, keys: Sequence[str]) -> dict[str, str]:
    """What a message says to set: the last value of each key."""
    pattern = re.compile(rf"\b({'|'.join(keys)}) = {_VALUE}")
    return {key: value.rstrip(".,;") for key, value in pattern.findall(message)}


def edited(text: str, message: str) -> tuple[str, tuple[str, ...]]:
    """A robot's file after following a message, at every joint alike, and the keys that were changed."""
    changed = []
    for table, keys in (("joints.drive", DriveTable.__struct_fields__), ("bus", BusTable.__struct_fields__)):
        for key, value in settings_in(message, keys).items():
            after = _with_key(text, table, key, value)
            if after != text:
                changed.append(key)
                text = after
    return text, tuple(changed)


def _with_key(text: str, table: str, key: str, value: str) -> str:
    """A TOML text with a key set in every table of a name."""
    head, *parts = re.split(r"^(?=\[)", text, flags=re.MULTILINE)
    line = f"{key} = {value}"
    for number, part in enumerate(parts):
        title, _, body = part.partition("\n")
        if title.strip("[] ") == table:
            body, there = re.subn(rf"^{key} = .*$", lambda _: line, body, flags=re.MULTILINE)
            parts[number] = f"{title}\n{'' if there else line + chr(10)}{body}"
    return head + "".join(parts)


def outcome_of(path: Path) -> Outcome:
    """Follow the messages with one description."""
    try:
        described = read_description(path)
    except DriverError as error:
        return Outcome(path.name, "", False, (), str(error))
    edits: list[tuple[str, ...]] = []
    with tempfile.TemporaryDirectory() as folder:
        for file in resources.files("armload_configs").iterdir():
            if file.name.startswith(_ARM):
                Path(folder, file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
        text = Path(folder, f"{_ARM}.toml").read_text(encoding="utf-8")
        while True:
            message = _message(text, Path(folder, f"{_ARM}.toml"), described)
            after, keys = edited(text, message)
            if not message or not keys or len(edits) == MOST_EDITS:
                return Outcome(path.name, described.vendor_name, not message, tuple(edits), message)
            edits.append(keys)
            text = after


def _message(text: str, file: Path, described: DeviceDescription) -> str:
    """What armload says about the arm; empty if it moves."""
    file.write_text(text, encoding="utf-8")
    try:
        robot = load_robot(str(file))
        wrong = _checked(robot, described)
        if not wrong:
            _move(robot, described)
    except (DriverError, ControlError) as error:
        return str(error)
    return wrong


def _checked(robot: Robot, described: DeviceDescription) -> str:
    """The errors of the check of one joint, the first that has any; empty if there are none."""
    wire, arm = LockstepWire(), robot.drives.settings
    with (
        LockstepBus(wire) as bus,
        LockstepBus(wire) as drives_bus,
        _drives(robot, described, drives_bus, VirtualClock()),
    ):
        rows = [
            row
            for row in check(CanopenBringUp(arm, bus, Timeouts())).steps
            if row.verdict in {Verdict.WRONG, Verdict.NOT_DONE}
        ]
    of = [row for row in rows if row.verdict is Verdict.WRONG] or rows
    return "\n".join(dict.fromkeys(row.detail for row in rows if row.node_id == of[0].node_id))


def _move(robot: Robot, described: DeviceDescription) -> None:
    """Enable the arm, move it, and bring it to rest without torque."""
    wire, clock, arm = LockstepWire(), VirtualClock(), robot.drives.settings
    with (
        LockstepBus(wire) as bus,
        LockstepBus(wire) as drives_bus,
        _drives(robot, described, drives_bus, clock),
        closing(CanopenServos(arm, bus, LockstepSync(clock))) as servos,
    ):
        servos.connect()
        target_rad = begin_rad = servos.enable().position_rad
        still = np.zeros(robot.n)
        for _ in range(_CYCLES):
            target_rad = target_rad + arm.cycle_s * _SPEED_RAD_S
            reached_rad = servos.exchange(JointCommand(target_rad, still, still)).position_rad
        if not (reached_rad > begin_rad).all():
            raise ControlError("the arm was enabled, and did not move")
        servos.stop()
        servos.disable()


def _drives(robot: Robot, described: DeviceDescription, bus: LockstepBus, clock: VirtualClock) -> SimulatedDrives:
    """Drives of an arm with the objects of a description."""
    drives = robot.drives.settings.drives
    traits = {drive.node_id: DriveTraits(description=described) for drive in drives}
    return SimulatedDrives(robot.drives.settings, IdealPlant(robot.simulation.start_rad), bus, clock, traits)


def described_in(folders: Sequence[Path]) -> Iterator[Path]:
    """The EDS and DCF files below folders."""
    for folder in folders:
        yield from sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES and path.is_file())


def run(folders: Sequence[Path]) -> list[Outcome]:
    """Follow the messages with every file of folders, and print a table by maker."""
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(outcome_of, described_in(folders)))
    by_maker = partial(sorted, key=lambda outcome: (outcome.maker.lower(), outcome.file))
    print("| maker | file | moves | edits | changed, or the last message |\n|---|---|---|---|---|")
    for maker, group in groupby(by_maker(found), key=lambda outcome: outcome.maker):
        for outcome in group:
            keys = "; ".join(", ".join(edit) for edit in outcome.edits) or "nothing"
            said = keys if outcome.moves else outcome.last.replace("\n", " // ")
            print(f"| {maker} | {outcome.file} | {'yes' if outcome.moves else 'no'} | {len(outcome.edits)} | {said} |")
    moving = sum(outcome.counts for outcome in found)
    print(f"\n{moving} of {len(found)} move within {ALLOWED_EDITS} edits")
    return found


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    begun_s = time.monotonic()
    run([Path(name) for name in sys.argv[1:]])
    print(f"{time.monotonic() - begun_s:.0f} s")
