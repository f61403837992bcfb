"""The arm of a command: by name, on another bus, or from a URDF."""

import pytest
import typer

from armload_controller.cli import given_arm as module
from armload_controller.cli.given_arm import ArmOnBus, DrivenArm, given_arm
from armload_controller.control_errors import ConfigurationError


@pytest.mark.parametrize(("base", "flange"), [("a", None), (None, "b")])
def test_links_need_a_urdf(base, flange):
    assert given_arm("prbt", None, None).name == "prbt"
    with pytest.raises(typer.BadParameter, match="select the arm in a URDF; ROBOT 'prbt' is none") as caught:
        given_arm("prbt", base, flange)
    assert caught.value.param_hint == "--base, --flange"


def test_links_of_a_missing_file_are_not_its_problem():
    with pytest.raises(ConfigurationError, match=r"^missing\.urdf: no such file, and no shipped robot"):
        given_arm("missing.urdf", None, "tool0")


def test_a_urdf_is_read_with_its_links(tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr("armload_controller.config.chain_from_urdf.read_urdf_arm", lambda *given: read.append(given))
    (tmp_path / "arm.urdf").write_text("<robot/>")
    assert given_arm(str(tmp_path / "arm.urdf"), "a", "b") is None
    assert read == [(str(tmp_path / "arm.urdf"), "a", "b")]


def test_bus_bitrate_and_cycle_replace_those_of_the_file():
    own = ArmOnBus("prbt").arm().bus
    assert own.in_virtual_time
    found = ArmOnBus("prbt", "socketcan:can7", 500_000).arm(125.0).bus
    assert (found.interface, found.channel, found.bitrate, found.cycle_hz) == ("socketcan", "can7", 500_000, 125.0)
    changed = ArmOnBus("prbt").arm(50.0).bus
    assert (changed.interface, changed.bitrate, changed.cycle_hz) == (own.interface, own.bitrate, 50.0)
    with pytest.raises((typer.BadParameter, ConfigurationError)):
        ArmOnBus("prbt", "can0").arm()


@pytest.mark.parametrize("simulated", [False, True])
@pytest.mark.parametrize("closed", [False, True])
def test_an_arm_is_opened_and_checked_as_the_options_say(monkeypatch, simulated, closed):
    opened, required = [], []
    monkeypatch.setattr("armload_controller.session.arm_access.open_arm", lambda *args, **kw: opened.append((args, kw)))
    monkeypatch.setattr("armload_controller.session.arm_access.require_rules", lambda *args, **kw: required.append(kw))
    monkeypatch.setattr(module, "attended", lambda: "somebody")
    driven = DrivenArm("prbt", simulated_drives=simulated)
    driven.require_rules("arm")
    screen = type("Screen", (), {"step": print})
    driven.opened("arm", screen, brakes_closed=closed)("load")
    said = {"simulated_drives": simulated, "attended": "somebody"}
    assert required == [said]
    assert opened == [(("arm", "load", print), {**said, "brakes_closed": closed})]
