"""Makes text from files and drives safe to print.

Names, messages and paths come from untrusted files and drives. A control character in them could move the cursor, hide
a line or change the window's title.
"""

from __future__ import annotations

import re
from typing import Final

_CONTROLS: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""All control characters except tab and line feed, characters that reverse text direction, and lone surrogates."""


def printable(text: str) -> str:
    r"""A text with its control characters as escapes, such as \u001b, which leaves a JSON document equivalent.

    Args:
        text: Any text.
    """
    return _CONTROLS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


_ARGUMENT: Final = re.compile(r"`([a-z][a-z0-9_]*)=`")
_OPTIONS: Final = {"robot": "ROBOT", "between_s": "--between", "single": "--float"}
"""Options whose name does not follow from the argument's."""


def as_options(text: str) -> str:
    """A message that names Python's arguments, as in `calibration=`, with the command line's options instead.

    Args:
        text: Any text.
    """
    return _ARGUMENT.sub(lambda found: _OPTIONS.get(found[1], f"--{found[1].replace('_', '-')}"), text)
