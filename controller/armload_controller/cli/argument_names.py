"""Messages that name Python's arguments, as the command line's options."""

from __future__ import annotations

import re
from typing import Final

_ARGUMENT: Final = re.compile(r"`([a-z][a-z0-9_]*)=`")
_OPTIONS: Final = {"robot": "ROBOT", "between_s": "--between", "single": "--float"}
"""Options whose name does not follow from the argument's."""


def as_options(text: str) -> str:
    """A message that names Python's arguments, as in `calibration=`, with the command line's options instead.

    Args:
        text: Any text.
    """
    return _ARGUMENT.sub(lambda found: _OPTIONS.get(found[1], f"--{found[1].replace('_', '-')}"), text)
