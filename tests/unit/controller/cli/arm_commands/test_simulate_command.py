"""`armload simulate`: payloads and their times."""

import signal
from contextlib import nullcontext

import numpy as np
import pytest
from typer import BadParameter

from armload_controller.cli.arm_commands import simulate_command
from armload_controller.cli.arm_commands.simulate_command import payload_change, payload_changes
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.session import arm_access
from armload_identification.files.payload_file import write_payload


@pytest.fixture(scope="module")
def simulation():
    return load_robot("er50").simulation


def test_payloads_by_name_and_by_file_in_the_order_of_time(simulation, make_subject, tmp_path):
    payload = make_subject().payload
    file = tmp_path / "tool.toml"
    write_payload(file, payload)
    named, path = simulation.payload_name, str(file)
    changes = payload_changes(
        [payload_change(text) for text in ("40s=none", f"10s={path}", f"2.5={named}")], simulation
    )
    assert [change.time_s for change in changes] == [2.5, 10.0, 40.0]
    assert changes[0].payload.mass_kg == simulation.payload(named).mass_kg
    assert changes[1].payload.mass_kg == pytest.approx(payload.model.mass_kg)
    np.testing.assert_allclose(changes[1].payload.center_of_mass_m, payload.model.center_of_mass_m)
    assert changes[2].payload is None
    assert simulation.plant_spec(path, changes=changes).changes == tuple(changes)


@pytest.mark.parametrize("text", ["soon=none", "10s", "10s=", "0s=none", "-1s=none", "inf=none", "nan=none"])
def test_what_is_no_change_is_refused(text):
    with pytest.raises(BadParameter, match=r"expected a time|not a time"):
        payload_change(text)


def test_one_payload_at_a_time(simulation):
    with pytest.raises(BadParameter, match="each time once"):
        payload_changes([(10.0, "none"), (10.0, "none")], simulation)
    with pytest.raises(ConfigurationError, match=r"simulation\.payloads"):
        payload_changes([(10.0, "anvil")], simulation)


@pytest.mark.parametrize("ended_by", ["the drives", "Ctrl-C"])
def test_drives_are_served_until_they_end_or_are_ended(armload, monkeypatch, interruptible, ended_by):
    looks = []

    class Drives:
        @property
        def running(self):
            return ended_by != "the drives" or len(looks) < 3

    def sleep(time_s):
        looks.append(time_s)
        assert len(looks) < 10, "it must end"
        if ended_by == "Ctrl-C" and len(looks) == 3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(arm_access, "drives_alone", lambda *given: nullcontext(Drives()))
    monkeypatch.setattr(simulate_command.time, "sleep", sleep)
    result = armload("simulate", "er50", "--bus", "socketcan:vcan0")
    assert result.exit_code == 0, result.output
    assert len(looks) == 3
    assert "drives stopped" in result.output
