"""Finds an arm's joints in the names that other programs give them: `ur10/wrist_1.pos` is `wrist_1_joint`.

A name is recognised by any separator and any prefix, and by the shortest end of it that no other joint has. A bare
number is no name: numbers may begin at 0 or 1, and the position of a joint in its arm is a different question.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

_WORDS: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


def words_of(name: str) -> list[str]:
    """The words and numbers of a name, in lower case.

    Args:
        name: Such as "wrist_1_joint", "J2 Position" or "elbowTorque".
    """
    return [word.lower() for word in _WORDS.findall(name)]


class JointNames:
    """The joints of an arm, by their names.

    Args:
        names: Names of the joints, base first.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._whole = [tuple(words_of(name)) for name in names]
        forms = [_name_endings(words, self._whole) for words in self._whole]
        counts = Counter(form for own in forms for form in own)
        self._name_endings = {form: joint for joint, own in enumerate(forms) for form in own if counts[form] == 1}
        self._longest = max((len(form) for form in self._name_endings), default=0)

    @property
    def numbered(self) -> bool:
        """Whether the names differ in numbers only, such as joint_1 to joint_6."""
        return len({tuple(word for word in words if not word.isdecimal()) for words in self._whole}) == 1

    def find(self, words: Sequence[str]) -> tuple[int, int, int, bool] | None:
        """The joint in the words of a name; None without one, and if there are several.

        Args:
            words: As `words_of` gives them.

        Returns:
            Its index, from 0; indices of the first word of its name and after the last; whether the name is whole.
        """
        for size in range(min(self._longest, len(words)), 0, -1):
            parts = {first: tuple(words[first : first + size]) for first in range(len(words) - size + 1)}
            found = {first: self._name_endings[part] for first, part in parts.items() if part in self._name_endings}
            if found:
                if len(set(found.values())) > 1:
                    return None
                first, joint = next(reversed(found.items()))
                return joint, first, first + size, parts[first] == self._whole[joint]
        return None

    def places(self, recorded: Sequence[str]) -> dict[int, int]:
        """Index in a recording by the index of each joint that it names; without joints that may be several.

        Args:
            recorded: Names of the recorded joints.
        """
        found: dict[int, list[int]] = {}
        for place, name in enumerate(recorded):
            joint = self.find(words_of(name))
            if joint is not None:
                found.setdefault(joint[0], []).append(place)
        exact = {joint: recorded.index(name) for joint, name in enumerate(self.names) if name in recorded}
        return {joint: places[0] for joint, places in found.items() if len(places) == 1} | exact


def _name_endings(words: tuple[str, ...], others: Sequence[tuple[str, ...]]) -> set[tuple[str, ...]]:
    """The ends of a joint's name, also without the words at the end that all joints share."""
    shared = 0
    while len(others) > 1 and shared < len(words) - 1 and len({other[-1 - shared :][:1] for other in others}) == 1:
        shared += 1
    ends = [words[first:] for first in range(len(words))]
    ends += [end[: len(end) - shared] for end in ends if len(end) > shared > 0]
    return {end for end in ends if end == words or (end[0].isalpha() and (len(end) > 1 or len(end[0]) > 1))}
