"""Text from a file or a drive, made so that it can do no more than be read.

Names, messages and paths come from untrusted files and drives. A control character among them would
move the cursor, hide a line or write the window's title.
"""

from __future__ import annotations

import re
from typing import Final

_CONTROLS: Final = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""All but tab and line feed; also what reverses the direction of a text, and halves of surrogate pairs."""


def printable(text: str) -> str:
    r"""A text with its control characters written out, such as \u001b; so JSON stays the same document.

    Args:
        text: From anywhere.
    """
    return _CONTROLS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)
