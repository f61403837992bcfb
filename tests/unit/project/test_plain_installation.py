"""Without extras the loop and the exports work, and every other command names its extra before doing anything."""

import subprocess
import sys
from pathlib import Path

import pytest

TRIAL = Path(__file__).resolve().parents[2] / "plain_installation.py"
HIDDEN = f"""
import sys
sys.path.insert(0, {str(TRIAL.parent)!r})
import plain_installation
sys.modules.update(dict.fromkeys(plain_installation.EXTRAS))
plain_installation.main()
"""
"""The trial program with the extras' libraries hidden; `.ci/run` runs it in an installation without them."""


@pytest.mark.pure
@pytest.mark.long
def test_loop_and_exports_work_and_the_rest_names_its_extra():
    done = subprocess.run([sys.executable, "-c", HIDDEN], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(done.stdout.splitlines()) == 4
