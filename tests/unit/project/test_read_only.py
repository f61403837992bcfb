"""Works from a read-only installation and without a home directory: it writes nothing but its results."""

import subprocess
import sys

import pytest

_PROGRAM = """
import os, sys, tempfile
written = []

def watch(event, args):
    if event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
        written.append(str(args[0]))
    elif event in ("os.mkdir", "os.rename", "os.remove"):
        written.append(str(args[0]))

sys.addaudithook(watch)
import numpy as np
from armload_controller.config.robot import load_robot
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline import payload_identification

robot = load_robot("er50")
state = np.zeros((3, robot.chain.n))
PayloadFeedforward(robot.chain, robot.payloads.expected).torque_nm(*state)
payload_regressor(robot.chain, *state)
from typer.testing import CliRunner
from armload_controller.cli.command_tree import app
result = CliRunner().invoke(app, ["identify", "--help"])
assert result.exit_code == 0, result.output
print(*written, sep="\\n")
"""


@pytest.mark.parametrize("home", ["/nonexistent/home", ""])
@pytest.mark.long
def test_no_file_is_written_by_loading_computing_or_asking_for_help(home):
    environment = {"HOME": home, "PATH": "/usr/bin:/bin", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.split() if line != "/dev/null"] == []
