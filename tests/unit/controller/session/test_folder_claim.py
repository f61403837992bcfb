"""Only one commissioning works in a folder at a time, however the other one ends."""

import subprocess
import sys

import pytest

from armload_controller.control_errors import CommissioningError
from armload_controller.session.folder_claim import claimed_folder

HOLDER = """
import sys, time
from pathlib import Path
from armload_controller.session.folder_claim import claimed_folder
with claimed_folder(Path(sys.argv[1])):
    print("claimed", flush=True)
    time.sleep(600)
"""


def test_a_folder_in_which_another_commissioning_is_at_work_is_left_alone(armload, recorded):
    with claimed_folder(recorded):
        result = armload("commission", "er50", "--output", recorded)
    assert isinstance(result.exception, CommissioningError)
    assert f"another commissioning is using {recorded}" in str(result.exception)
    assert not (recorded / "payload.toml").exists()


def test_a_claim_ends_with_its_process_even_by_kill_minus_nine(tmp_path):
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    with holder:
        assert holder.stdout.readline() == "claimed\n"
        with pytest.raises(CommissioningError, match="is using"), claimed_folder(tmp_path):
            pass
        holder.kill()
    with claimed_folder(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []
