"""Only the cycle commands servos, only a session creates a cycle, and only the checks create a checked path."""

import re
from pathlib import Path

import pytest

import armload_controller

PACKAGE = Path(armload_controller.__file__).parent


@pytest.mark.parametrize(
    ("pattern", "files"),
    [
        (r"\.exchange\(", {"cycle/control_cycle.py"}),
        (r"\bCycle\(", {"session/run_session.py"}),
        (r"object\.__new__\(", {"motion/checked_path.py"}),
        (r"\.powered\(\)", {"session/run_session.py"}),
    ],
)
def test_where_it_is_done(pattern, files):
    found = {
        str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if re.search(pattern, path.read_text("utf-8"))
    }
    assert found == files
