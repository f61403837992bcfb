"""The load of a session; a module of its own, which commands load for their options."""

from __future__ import annotations

from enum import StrEnum


class SessionLoad(StrEnum):
    """Load on the flange during a session."""

    UNLOADED = "unloaded"
    LOADED = "loaded"
