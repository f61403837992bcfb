"""Makes text from files and drives safe to show.

Names, messages and paths come from untrusted files and drives. A control character in them could move the cursor, hide
a line, change the window's title, turn the direction of what follows, or make a figure ill-formed.
"""

from __future__ import annotations

import re
from typing import Final

_CONTROLS: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""All control characters except tab and line feed, those that reverse text direction, and what is no character."""


def printable(text: str) -> str:
    r"""A text with its control characters as escapes, such as \u001b, which leaves a JSON document equivalent.

    Args:
        text: Any text.
    """
    return _CONTROLS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)
