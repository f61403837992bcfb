"""Tools by name."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.analysis.tools import add_tool, tool_names, tool_payload, tools_folder
from armload_controller.control_errors import ConfigurationError
from armload_identification.files.payload_file import write_payload
from armload_identification.identification_errors import PayloadFileError


@pytest.fixture
def file(tmp_path, monkeypatch, make_subject):
    """A payload file; tools are kept in a folder of the test."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    write_payload(tmp_path / "payload.toml", make_subject().payload)
    return tmp_path / "payload.toml"


def test_a_tool_is_found_by_name_and_a_file_by_its_path(file):
    assert tool_names() == ()
    assert add_tool("gripper", file) == tools_folder() / "gripper.toml"
    assert tool_names() == ("gripper",)
    assert tool_payload("gripper").model.mass_kg == pytest.approx(2.7)
    assert tool_payload(str(file)).model.mass_kg == pytest.approx(2.7)
    add_tool("gripper", file)  # the same again


def test_another_payload_under_a_name_is_refused(file, make_subject):
    add_tool("gripper", file)
    other = make_subject(undetermined=("ixx",)).payload
    write_payload(file, other)
    with pytest.raises(ConfigurationError, match="another payload has this name; choose another one, or remove"):
        add_tool("gripper", file)


@pytest.mark.parametrize("name", ["../gripper", "", "a b", ".hidden", "x" * 65])
def test_a_name_is_no_path(file, name):
    with pytest.raises(ConfigurationError, match="expected letters, digits, - and _"):
        add_tool(name, file)


def test_a_tool_without_mass_is_refused(file, make_subject):
    payload = make_subject().payload
    write_payload(file, replace(payload, determined=payload.determined & (np.arange(10) > 0)))
    with pytest.raises(PayloadFileError, match="expected a payload with determined mass and centre of mass"):
        add_tool("gripper", file)


def test_an_unknown_tool_is_refused_with_the_nearest(file):
    add_tool("gripper", file)
    with pytest.raises(ConfigurationError, match=r"no such tool, and no such file\. Did you mean gripper\?"):
        tool_payload("griper")
