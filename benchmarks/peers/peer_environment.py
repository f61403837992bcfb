"""Path of the peers' interpreter."""

from __future__ import annotations

from pathlib import Path
from typing import Final

PEERS_PYTHON: Final = Path(__file__).parent / ".venv" / "bin" / "python"
"""Has casadi; if it is missing, the tables report that a peer was not measured."""
