"""Whether an operator is at the terminal; imports nothing heavy, so that help can use it too."""

from __future__ import annotations

import sys


def attended() -> bool:
    """Whether an operator is at a terminal and can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()
