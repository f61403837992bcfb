"""The simulated twin of a robot file."""

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.files.payload_file import write_payload


def test_a_twin_carries_a_body_of_its_own_file_or_of_a_payload_file(make_subject, tmp_path):
    simulation = load_robot("er50").simulation
    own = simulation.payload("paper")
    np.testing.assert_allclose(simulation.mounted("paper").mass_kg, own.mass_kg)
    payload = make_subject().payload
    write_payload(tmp_path / "found.toml", payload)
    mounted = simulation.mounted(str(tmp_path / "found.toml"))
    assert mounted.mass_kg == pytest.approx(payload.model.mass_kg)
    np.testing.assert_allclose(mounted.center_of_mass_m, payload.model.center_of_mass_m, rtol=1e-6)
    np.testing.assert_allclose(mounted.inertia_kg_m2, payload.model.inertia_about_com, rtol=1e-6)
    with pytest.raises(ConfigurationError, match=r"expected one of .*paper.*path of a payload file"):
        simulation.mounted("papers")


def test_two_runs_do_not_share_their_noise():
    robot = load_robot("er50")
    assert robot.simulation.plant_spec(None, run=0).seed != robot.simulation.plant_spec(None, run=1).seed
