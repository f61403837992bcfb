"""Peak memory of a process."""

from __future__ import annotations

import re
from pathlib import Path
from resource import getpagesize


def peak_bytes() -> int:
    """Greatest resident memory of this program; `ru_maxrss` also includes that of the program that started it."""
    status = Path("/proc/self/status").read_text("ascii")
    found = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.MULTILINE)
    if found is None:
        raise RuntimeError("/proc/self/status has no VmHWM")
    return 1024 * int(found.group(1))


def resident_bytes() -> int:
    """Resident memory of this program now."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * getpagesize()
