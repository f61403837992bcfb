"""What a worker of this machine does before its first job: Dask imports this, also in one that it starts again."""

from __future__ import annotations

import signal
from typing import Any

import armload_controller.fleet.work  # noqa: F401 - a job finds it loaded


def dask_setup(_worker: Any) -> None:
    """Leave Ctrl-C to the coordinator, which the terminal sends it to as well."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
