"""A first robot file, drafted from the URDF of an arm of five joints."""

from dataclasses import replace

import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.new_robot.arm_draft import draft_of_urdf
from armload_controller.new_robot.draft_text import draft_file
from armload_controller.new_robot.payload_draft import tool_sphere
from armload_controller.new_robot.workspace_draft import workspace_of_urdf
from tests.five_joints import URDF


@pytest.fixture
def drafted(tmp_path):
    """Writes the URDF and the file drafted from it."""

    def drafted(text=URDF, payload_kg=2.0, bus=None):
        (tmp_path / "five.urdf").write_text(text)
        arm = read_urdf_arm(tmp_path / "five.urdf", flange="hand")
        draft = draft_of_urdf(arm)
        workspace = workspace_of_urdf(arm, draft, tool_sphere(arm.n, payload_kg))
        file = draft_file(draft, payload_kg, replace(workspace, urdf="five.urdf"), bus)
        (tmp_path / "five.toml").write_text(file.text)
        return arm, file, tmp_path / "five.toml"

    return drafted
