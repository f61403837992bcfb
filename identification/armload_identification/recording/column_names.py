"""Recognises the columns of a table by their names: `q1`, `joint_2_pos_deg`, `actual_current_0`, `elbow.effort`.

A name is split into words and numbers. One word is the quantity, others are the unit or show that the column is not a
measurement of a joint. The rest is the joint: one of the arm's, if the arm is known and the column names it; else a
number; else a name of its own. Columns that differ in the joint only are a series, such as `tau_1` to `tau_6`. Of each
quantity one series is used. A series with a word that no other quantity has, such as `motor_torque_1`, may be something
else, and is not taken without asking; nor is one in an unknown unit. Columns without a unit are assumed to be in SI
units; wrong units are detected later, by their magnitude.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any, Final

from armload_identification.identification_errors import NamelessColumns, RecordingError
from armload_identification.recording.column_units import plain_text, unit_factor, units_of
from armload_identification.recording.csv_columns import QUANTITIES_BY_KEY, CsvColumns
from armload_identification.recording.joint_names import JointNames, words_of

_IN_BRACKETS: Final = re.compile(r"[\[(<]\s*([^\[\](<>)]*[^\[\](<>)\d\s][^\[\](<>)]*)[\])>]")
_QUANTITIES: Final = {
    "position_rad": {"q", "pos", "position", "positions", "angle", "angles", "theta", "winkel", "stellung"},
    "velocity_rad_s": {"qd", "dq", "qdot", "vel", "velocity", "velocities", "speed", "drehzahl", "vitesse"},
    "current_a": {"current", "currents", "curr", "i", "strom", "courant"},
    "torque_nm": {"torque", "torques", "tau", "effort", "efforts", "moment", "trq", "tor", "drehmoment", "couple"},
}
_ARRAYS: Final = {
    "time_s": ("time_s", "timestamp", "time", "t"),
    "position_rad": ("position_rad", "observation.state", "observation.position", "position", "positions", "q"),
    "velocity_rad_s": ("velocity_rad_s", "observation.velocity", "velocity", "velocities", "dq", "qd"),
    "current_a": ("current_a", "observation.current", "current", "currents", "i"),
    "torque_nm": ("torque_nm", "observation.effort", "observation.torque", "effort", "torque", "torques", "tau"),
}
"""Names of arrays, and of columns of lists, with the numbers of all joints; the first that is there is used."""
_TIMES: Final = ("timestamp", "time", "t", "stamp", "zeit", "temps")
_AROUND_TIME: Final = {"header", "field", "joint", "states", "state", "receive", "elapsed", "in", "msg", "robot"}
_NOT_MEASURED: Final = {
    *("target", "desired", "des", "d", "command", "commanded", "cmd", "ref", "reference", "setpoint", "goal"),
    *("action", "soll", "sollwert", "consigne", "error", "err", "tcp", "temperature", "temp", "voltage", "window"),
    *("limit", "max", "min", "std", "offset", "ext", "external", "hat", "model", "gravity", "friction", "coriolis"),
    *("residual", "feedforward", "ff", "predicted", "simulated", "sim", "acc", "ddq", "qdd", "acceleration", "pose"),
    "rate",
}
_MEASURED: Final = {"actual", "act", "measured", "meas", "msr", "ist", "istwert", "feedback", "mesure", "mesuree"}
_FILLERS: Final = {
    *("observation", "state", "states", "joint", "joints", "axis", "axes", "achse", "axe", "gelenk", "j", "a"),
    *("field", "value", "values"),
}
_OTHER_SIDE: Final = {"motor", "encoder", "raw", "rotor"}
"""Words of positions, velocities and torques on the motors' side of the gears."""
_NO_UNIT: Final = {"percent", "pct", "permille", "counts", "count", "ticks", "inc", "increments", "norm", "pu"}
_STATED_ELSEWHERE: Final = {("time", "success", "rate"): 1e-3, ("time", "field", "header", "seq"): 1e-9}
"""Factor of times without a unit, by the first words of the header: libfranka counts in ms, rostopic in ns."""
_UNIT_WORDS: Final = 4
_NUMBER: Final = "#"
_NEEDED: Final = 2


@dataclass(frozen=True)
class _Column:
    """A column of one quantity.

    Attributes:
        quantity: Name of the quantity.
        by: The word that says so.
        words: All other words and numbers, without unit and fillers.
        label: The same with the fillers, which may be part of a joint's name.
        factor: Factor to SI; None for an unknown unit.
        measured: Whether the name says that it was measured.
    """

    quantity: str
    by: str
    words: tuple[str, ...]
    label: tuple[str, ...]
    factor: float | None
    measured: bool


@dataclass(frozen=True)
class _Series:
    """The columns of one quantity that differ in the joint only.

    Attributes:
        quantity: Name of the quantity.
        words: Words that all columns have, without the one that names the quantity.
        places: Index of the column of each joint.
        twice: Indices of several columns of one joint.
        factors: Factors to SI of the columns, None for unknown units.
        preferred: How much the names say that this is it: measured, and the joint's whole name.
    """

    quantity: str
    words: frozenset[str]
    places: Mapping[int | str, int]
    twice: tuple[int, ...]
    factors: tuple[float | None, ...]
    preferred: tuple[bool, bool]


_Member = tuple[tuple[Any, ...], Any, int, _Column, bool]
"""A column: what all of its series have in common, beginning with quantity and the word for it; its joint; place and
meaning; and whether the whole name of the joint is there."""


def columns_by_name(path: Path, names: Sequence[str], joint_names: Sequence[str] = ()) -> CsvColumns:
    """Find time, positions, and velocities, currents and torques of the same joints.

    Args:
        path: Name of the table in messages.
        names: Names of its columns.
        joint_names: Names of the arm's joints, if known; they have priority over numbers.

    Raises:
        RecordingError: no time, no positions, an ambiguous choice, an unknown unit, or a quantity in two units; the
            message contains an option that answers the question.
    """
    return _Header(path, names, JointNames(joint_names)).columns()


def arrays_by_name(names: Collection[str]) -> dict[str, str]:
    """The array of each quantity of all joints, as far as there is one.

    Args:
        names: Names of the arrays of an archive, or of a table's columns of lists.
    """
    found = {quantity: next((name for name in known if name in names), "") for quantity, known in _ARRAYS.items()}
    return {quantity: name for quantity, name in found.items() if name}


class _Header:
    """The names of a table's columns."""

    def __init__(self, path: Path, names: Sequence[str], arm: JointNames) -> None:
        self._path, self._names, self._arm = path, list(names), arm
        texts = [plain_text(name).strip().lstrip("%").replace("%", " percent ") for name in names]
        brackets = [found[-1].strip() if (found := _IN_BRACKETS.findall(text)) else "" for text in texts]
        self._parts = [_name(text, unit, brackets) for text, unit in zip(texts, brackets, strict=True)]
        meanings = ((place, _column(words, unit)) for place, (words, unit) in enumerate(self._parts))
        self._measured = [(place, column) for place, column in meanings if column is not None]
        self._time, self._time_factor = self._times()
        self._of_arm = self._by_joint() if arm.names else []
        self._of_others = self._by_number() or self._by_label()

    def columns(self) -> CsvColumns:
        """See `columns_by_name`."""
        by_arm = any(series.quantity == "position_rad" for series in self._of_arm)
        every = self._of_arm if by_arm else self._of_others
        chosen: dict[str, _Series] = {}
        for quantity in ("position_rad", "velocity_rad_s", "torque_nm", "current_a"):
            series = self._choice(quantity, every, chosen, numbered=not by_arm)
            if series is not None:
                chosen[quantity] = series
        if not self._time or "position_rad" not in chosen:
            what = "no positions of two or more joints" if self._time else "no time column"
            raise self._open_question(f"{what} can be recognised in the header {', '.join(self._names)}")
        self._require_arm(chosen["position_rad"], by_arm=by_arm)
        return self._as_columns(chosen)

    def _open_question(self, question: str) -> RecordingError:
        """The error for what the names leave open."""
        nameless = not any(one.quantity == "position_rad" for one in (*self._of_arm, *self._of_others))
        return (NamelessColumns if nameless else RecordingError)(
            f"{self._path}: {question}. Specify columns and units, such as {self._suggestion()}, or a [log] table in "
            "the robot's file."
        )

    def _choice(
        self, quantity: str, every: Sequence[_Series], chosen: Mapping[str, _Series], *, numbered: bool
    ) -> _Series | None:
        """The series of a quantity; None if there is none, or if the question does not matter."""
        uses = {(word, series.quantity) for series in every for word in series.words}
        shared = {word for word, count in Counter(word for word, _ in uses).items() if count > 1}
        found = [series for series in every if series.quantity == quantity]
        matters = quantity != "velocity_rad_s" and not (quantity == "current_a" and "torque_nm" in chosen)
        if "position_rad" in chosen:
            positions = chosen["position_rad"]
            joints = set(positions.places)
            enough = 0 if self._arm.names else len(joints)
            others = [one for one in found if set(one.places) != joints and len(one.places) >= enough]
            found = [one for one in found if joints == set(one.places) or (joints < set(one.places) and not numbered)]
            if others and not found and matters and numbered:
                both = f"{self._shown(positions)} and {self._shown(others[0])}"
                raise self._open_question(f"{both} are not of the same joints")
        elif len(found) == 1 and not numbered:
            shared |= found[0].words  # a prefix of the joints' names
        plain = [one for one in found if one.words <= shared]
        plain = [one for one in plain if quantity == "current_a" or not one.words & _OTHER_SIDE]
        best = max((one.preferred for one in plain), default=None)
        plain = [one for one in plain if one.preferred == best]
        doubtful = len(plain) != 1 or len(set(plain[0].factors)) > 1 or plain[0].factors[0] is None
        if not found or (doubtful and not matters):
            return None
        first = (plain or found)[0]
        places = first.twice or [next(iter(one.places.values())) for one in (plain or found)[:2]]
        if len(places) > 1:
            listed = " and ".join(self._names[place] for place in places)
            raise self._open_question(f"{listed} could both be the {quantity} of one joint")
        if not plain:
            raise self._open_question(f"{self._shown(first)} may not be the {quantity} of the joints")
        if set(first.factors) == {None}:
            raise self._open_question(f"{self._shown(first)} have an unknown unit, known are {units_of(quantity)}")
        other = next((k for k, factor in enumerate(first.factors) if factor != first.factors[0]), None)
        if other is not None:
            names = [self._names[place] for place in first.places.values()]
            raise self._open_question(
                f"{names[0]} and {names[other]} are the {quantity} of two joints in different units; SI units are "
                "assumed where the name has none"
            )
        return first

    def _shown(self, series: _Series) -> str:
        """The first and the last column of a series, for messages."""
        places = list(series.places.values())
        return f"{self._names[places[0]]} to {self._names[places[-1]]}"

    def _as_columns(self, chosen: Mapping[str, _Series]) -> CsvColumns:
        """The columns of the joints that have positions, with the units that their names state."""
        joints = list(chosen["position_rad"].places)
        scale = {"time_s": self._time_factor} | {name: series.factors[0] or 1.0 for name, series in chosen.items()}
        places = {"time_s": self._time or [0]} | {
            quantity: [chosen[quantity].places[joint] for joint in joints if joint in chosen[quantity].places]
            for quantity in QUANTITIES_BY_KEY.values()
            if quantity in chosen
        }
        return CsvColumns(
            {quantity: [self._called(place) for place in group] for quantity, group in places.items()},
            scale={name: factor for name, factor in scale.items() if factor != 1.0},
            joint_names=tuple(joint for joint in joints if isinstance(joint, str)),
        )

    def _called(self, place: int) -> int | str:
        """A column's name, or its number if others have that name too."""
        name = self._names[place]
        return name if self._names.count(name) == 1 else place

    def _require_arm(self, positions: _Series, *, by_arm: bool) -> None:
        """Raise if the joints of the positions may not be those of the arm."""
        arm, joints = self._arm, list(positions.places)
        if by_arm and arm.numbered:
            for other in self._of_others:
                if 0 in other.places and set(positions.places.values()) <= set(other.places.values()):
                    raise self._open_question(
                        f"{self._names[other.places[0]]} may be the first joint, or none of {', '.join(arm.names)}"
                    )
        if by_arm or not arm.names:
            return
        start = joints[0] if isinstance(joints[0], int) else 0
        if joints != list(range(start, start + len(arm.names))):
            shown = ", ".join(self._names[place] for place in positions.places.values())
            raise self._open_question(f"{shown} may not be the arm's joints, {', '.join(arm.names)}")

    def _suggestion(self) -> str:
        """The option for the likeliest meaning, for the user to correct."""
        every = [*self._of_arm, *self._of_others]
        likely: dict[str, _Series] = {}
        for quantity in _QUANTITIES:
            found = [one for one in every if one.quantity == quantity and len(set(one.factors)) == 1]
            if found and (not likely or len(found[0].places) >= len(likely["position_rad"].places)):
                likely[quantity] = found[0]
            elif quantity == "position_rad":
                break
        n = len(self._arm.names) or (len(self._names) - 1) // 2
        if not likely:
            places = [place for place in range(len(self._names)) if place != (self._time or [0])[0]]
            groups = {"time_s": self._time or [0], "position_rad": places[:n], "torque_nm": places[n : 2 * n]}
            return CsvColumns(groups, {"time_s": self._time_factor}).option(self._names)
        return self._as_columns(likely).option(self._names)

    def _times(self) -> tuple[list[int], float]:
        """Places of the time, if there is one, and of nanoseconds to add to it, and the factor of the time."""
        first = tuple(word for words, _ in self._parts[:2] for word in words)
        default = next((factor for start, factor in _STATED_ELSEWHERE.items() if first[: len(start)] == start), 1.0)
        found: list[tuple[int, int, int, tuple[str, ...], float]] = []
        for place, (words, unit) in enumerate(self._parts):
            kinds = [_TIMES.index(word) for word in words if word in _TIMES]
            if not kinds:
                continue
            rest = tuple(word for word in words if word not in _TIMES and word not in _AROUND_TIME)
            factor = unit_factor("time_s", unit or "".join(rest)) if unit or rest else default
            if factor is not None:
                around = tuple(word for word in words if word not in rest)
                found.append((min(kinds), len(around), place, around, factor))
        if not found:
            return [], 1.0
        *_, place, around, factor = min(found)
        pair = [other[2] for other in found if other[3:] == (around, 1e-9)] if factor == 1.0 else []
        return [place, *pair[:1]], factor

    def _by_joint(self) -> list[_Series]:
        """The series in which every joint of the arm is named."""
        names, members = self._arm.names, []
        for place, (words, unit) in enumerate(self._parts):
            joint, first, end, whole = self._arm.find(words) or (None, 0, 0, False)
            column = _column(words[:first] + words[end:], unit)
            if joint is not None and column is not None:
                members.append(((column.quantity, column.by, *column.words), names[joint], place, column, whole))
        return _series(members, len(names), names.index)

    def _by_number(self) -> list[_Series]:
        """The series of numbered columns; none if numbers are only a part of the joints' names."""
        patterns: dict[tuple[str, ...], list[tuple[int, _Column, tuple[int, ...]]]] = {}
        for place, column in self._measured:
            numbers = tuple(int(word[:9]) for word in column.words if word.isdecimal())
            pattern = tuple(_NUMBER if word.isdecimal() else word for word in column.words)
            patterns.setdefault((column.quantity, column.by, *pattern), []).append((place, column, numbers))
        members: list[_Member] = []
        for key, columns in patterns.items():
            slots = [slot for slot in range(len(columns[0][2])) if len({numbers[slot] for *_, numbers in columns}) > 1]
            for place, column, numbers in columns if slots else ():
                others = (number for slot, number in enumerate(numbers) if slot != slots[-1])
                members.append(((*key, *others), numbers[slots[-1]], place, column, True))
        found = _series(members, _NEEDED, int)
        positions = [series for series in found if series.quantity == "position_rad"]
        all_positions = sum(column.quantity == "position_rad" for _, column in self._measured)
        numbered = sum(len(series.places) for series in positions)
        alike = len({tuple(series.places) for series in positions}) == 1 and numbered == all_positions
        return found if alike or any(not series.words for series in positions) else []

    def _by_label(self) -> list[_Series]:
        """The series whose columns are told apart by any words."""
        labels = [column.label for _, column in self._measured if column.quantity == "position_rad"]
        same = list(takewhile(lambda words: len(set(words)) == 1, zip(*labels, strict=False)))
        shared = min([len(same) if len(labels) >= _NEEDED else 0, *(len(label) - 1 for label in labels)])
        named = [(place, column, "_".join(column.label[shared:])) for place, column in self._measured]
        return _series([((c.quantity, c.by), label, place, c, True) for place, c, label in named if label], _NEEDED)


def _name(text: str, unit: str, brackets: Sequence[str]) -> tuple[list[str], str]:
    """Words of a name, and its unit; text in brackets that few columns have and that is no unit belongs to the name."""
    known = any(unit_factor(quantity, unit) is not None for quantity in QUANTITIES_BY_KEY.values())
    words = {word for word in words_of(unit) if word not in _MEASURED | _NOT_MEASURED | _FILLERS}
    apart = bool(words) and (known or brackets.count(unit) > len(_QUANTITIES))
    rest = _IN_BRACKETS.sub(lambda found: " " if apart and found[1].strip() == unit else found[0], text)
    return words_of(rest), unit if apart else ""


def _column(words: Sequence[str], unit: str) -> _Column | None:
    """The meaning of a name; None if it is not a measurement of a joint."""
    if _NOT_MEASURED & set(words):
        return None
    if "as" in words:  # the current as a torque
        words = words[words.index("as") + 1 :]
    quantities = [name for name, synonyms in _QUANTITIES.items() if synonyms & set(words)]
    # A single letter may be part of a name: longer words have priority, such as "position" over "i".
    if len(quantities) > 1:
        quantities = [name for name in quantities if any(len(word) > 1 for word in _QUANTITIES[name] & set(words))]
    if len(quantities) != 1:
        return None
    quantity = quantities[0]
    by = max((word for word in words if word in _QUANTITIES[quantity]), key=len)
    rest = [word for word in words if word != by]
    factor, rest = _without_unit(quantity, rest) if not unit else (unit_factor(quantity, unit), rest)
    measured = bool(_MEASURED & set(rest))
    label = tuple(word for word in rest if word not in _MEASURED and word not in {"observation", "state"})
    return _Column(quantity, by, tuple(word for word in label if word not in _FILLERS), label, factor, measured)


def _without_unit(quantity: str, words: Sequence[str]) -> tuple[float | None, list[str]]:
    """Factor of a unit among the words, None if it is unknown, and the other words."""
    if _NO_UNIT & set(words):
        return None, [word for word in words if word not in _NO_UNIT]
    for size in range(_UNIT_WORDS, 0, -1):
        for first in range(len(words) - size, -1, -1):
            factor = unit_factor(quantity, "".join(words[first : first + size]))
            if factor is not None:
                return factor, [*words[:first], *words[first + size :]]
    return 1.0, list(words)


def _series(members: Iterable[_Member], fewest: int, order: Callable[[Any], int] = lambda _joint: 0) -> list[_Series]:
    """The series of columns, of at least so many joints; joints are ordered, else as they come."""
    groups: dict[tuple[Any, ...], dict[Any, list[tuple[int, _Column, bool]]]] = {}
    for key, joint, place, column, whole in members:
        groups.setdefault(key, {}).setdefault(joint, []).append((place, column, whole))
    found = []
    for (quantity, _, *words), of_joint in groups.items():
        joints = {joint: of_joint[joint] for joint in sorted(of_joint, key=order)}
        columns = [entry for entries in joints.values() for entry in entries]
        one = _Series(
            quantity,
            frozenset(words) - {_NUMBER},
            {joint: entries[0][0] for joint, entries in joints.items()},
            next((tuple(place for place, *_ in entries) for entries in joints.values() if len(entries) > 1), ()),
            tuple(column.factor for _, column, _ in columns),
            (all(column.measured for _, column, _ in columns), all(whole for *_, whole in columns)),
        )
        found += [one] if len(joints) >= fewest else []
    return found
