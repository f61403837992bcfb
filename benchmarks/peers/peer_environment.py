"""Where the peers' interpreter is."""

from __future__ import annotations

from pathlib import Path
from typing import Final

PEERS_PYTHON: Final = Path(__file__).parent / ".venv" / "bin" / "python"
"""It has casadi; where it is not there, a table says that a peer was not measured."""
