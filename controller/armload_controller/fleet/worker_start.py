"""Start-up of a local worker before its first job: Dask imports this module, also in a restarted worker."""

from __future__ import annotations

import signal
from typing import Any

import armload_controller.fleet.job_processing  # noqa: F401 - loaded before the first job


def dask_setup(_worker: Any) -> None:
    """Leave Ctrl-C to the coordinator, which also receives it from the terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
