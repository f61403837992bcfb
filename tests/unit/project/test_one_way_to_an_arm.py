"""Only the cycle commands servos, only a session creates a cycle and follows a leg, only the checks create a checked
path, and only what begins with the rules for a real arm creates a master on a bus."""

import re
from pathlib import Path

import pytest

import armload_controller
import armload_drivers

PACKAGE = Path(armload_controller.__file__).parent


@pytest.mark.parametrize(
    ("pattern", "files"),
    [
        (r"\.exchange\(", {"cycle/control_cycle.py"}),
        (r"\bCycle\(", {"session/run_session.py"}),
        (r"object\.__new__\(", {"motion/checked_path.py"}),
        (r"\.powered\(\)", {"session/run_session.py"}),
        (r"servos\.enable\(", {"cycle/control_cycle.py"}),
        (r"\barm\.follow\(", {"session/run_session.py"}),
        (r"\brun_leg\(", {"session/run_session.py"}),
        (r"\bRunSession\(", {"session/run_session.py"}),
        (r"\bCanopenServos\(", {"session/arm_access.py"}),
        (r"\bEthercatServos\(", {"session/arm_access.py"}),
    ],
)
def test_where_it_is_done(pattern, files):
    found = {
        str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if re.search(pattern, path.read_text("utf-8"))
    }
    assert found == files


def test_one_function_resets_drives_and_requires_their_states_and_one_where_torque_must_go():
    modules = {path.name: path.read_text("utf-8") for path in Path(armload_drivers.__file__).parent.rglob("*.py")}

    def using(pattern):
        return {name for name, text in modules.items() if re.search(pattern, text)}

    assert using(r"command\(NmtCommand\.RESET") == {"safe_reset.py", "drive_node.py"}
    assert using(r"\bnode\.restart\b") == {"torque_removal.py"}
