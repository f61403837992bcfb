"""A calibrated arm as URDF: Pinocchio computes the calibrated torque from it, and every link is physically possible."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

from armload_controller.cli.command_tree import app
from armload_controller.config.robot import load_robot
from armload_controller.export.calibrated_urdf import arm_urdf
from armload_identification.calibration.calibration_result import ArmCalibration, CalibratedRun, kinematics_sha256
from armload_identification.calibration.possible_links import possible_links
from armload_identification.files.calibration_file import write_calibration
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import InertialParameters, Provenance
from armload_identification.model.regressor import body_regressor
from armload_identification.recording.reading_options import Effort


@pytest.fixture(scope="module")
def arm():
    return load_robot("prbt")


@pytest.fixture(scope="module")
def calibration(arm, any_body):
    """The result of an error-free identification of the arm's links, as base parameters."""
    n, chain = arm.n, arm.chain
    rng = np.random.default_rng(3)
    truth = np.array([any_body(rng).theta for _ in range(n)])
    base = base_columns(chain, np.eye(n))[: 10 * n]
    columns = body_regressor(chain, *states(n, 200)).reshape(-1, 10 * n)
    links = np.zeros(10 * n)
    links[base] = np.linalg.lstsq(columns[:, base], columns @ truth.ravel())[0]
    per_joint = np.arange(1.0, n + 1.0)
    body = BodyModel(
        links=links.reshape(n, 10),
        rotor_inertia_kg_m2=0.1 * per_joint,
        viscous_nm_s_rad=2.0 * per_joint,
        coulomb_nm=np.append(per_joint[:-1], -0.1),
        coupling=np.eye(n),
        base=base.reshape(n, 10),
        root_nm=np.zeros(n),
        offset_nm=np.zeros(n),
        load_friction=0.01 * per_joint,
        torque_delay_s=0.0,
        reversal_speed_rad_s=0.01 * np.ones(n),
    )
    return ArmCalibration(
        robot="prbt",
        effort=Effort.TORQUE,
        gain_nm_a=np.ones(n),
        nominal=np.ones(n),
        body=body,
        tilt_rad=np.zeros(2),
        covariance=1e-4 * np.eye(6 * n + int(base.sum()) + 3),
        drift=np.ones((3, n)),
        noise_nm=np.ones(n),
        correlation_s=np.ones(n),
        level_nm=np.ones(n),
        payloads=(),
        runs=(
            CalibratedRun(
                name="a.mcap",
                mounting="",
                recorded="",
                residual_rms_nm=np.ones(n),
                off=1.0,
                friction_changes=np.zeros((3, n)),
                influence=np.zeros(n),
                rows=1000,
                struck=0,
            ),
        ),
        left_out=(),
        warnings=(),
        kinematics_sha256=kinematics_sha256(chain),
        provenance=Provenance("1", arm.sha256, {}),
    )


def states(n, count):
    return np.random.default_rng(7).uniform(-2.0, 2.0, (3, count, n))


def torque_of(text, of_arm):
    """(N, n) Pinocchio's torque for a URDF at the states, plus the rotors', for which URDF has no element."""
    model = pin.buildModelFromXML(text)
    model.armature = of_arm.rotor_inertia_kg_m2
    data = model.createData()
    return np.array([pin.rnea(model, data, *state) for state in zip(*states(of_arm.n, 50), strict=True)])


@pytest.mark.parametrize("tilt_rad", [(0.0, 0.0), (2e-3, -1e-3)])
def test_pinocchio_finds_the_calibrated_torque(arm, calibration, tilt_rad):
    calibration = replace(calibration, tilt_rad=np.array(tilt_rad))
    chain = calibration.level(arm.chain)
    possible = possible_links(chain, calibration)
    assert possible.exact
    assert all(InertialParameters(theta).is_physical for theta in possible.links)
    assert np.all(possible.links[:, 0] > 0.0)
    ((name, text),) = arm_urdf(arm, calibration, possible, "a test").items()
    assert name == "prbt_calibrated.urdf"
    q, dq, ddq = states(arm.n, 50)
    expected = calibration.body.link_torque(chain, q, dq, ddq) + ddq @ calibration.body.rotor_mass_kg_m2
    np.testing.assert_allclose(torque_of(text, calibration.body), expected, atol=1e-9)


def test_an_arm_that_hangs_from_the_ceiling_does_so_in_the_world(arm, calibration, edited):
    hanging = load_robot(edited("gravity_m_s2 = [0.0, 0.0, -9.81]", "gravity_m_s2 = [0.0, 0.0, 9.81]", robot="prbt"))
    chain = hanging.chain
    possible = possible_links(chain, calibration)
    ((_, text),) = arm_urdf(hanging, calibration, possible, "a test").items()
    q, dq, ddq = states(arm.n, 50)
    expected = calibration.body.link_torque(chain, q, dq, ddq) + ddq @ calibration.body.rotor_mass_kg_m2
    np.testing.assert_allclose(torque_of(text, calibration.body), expected, atol=1e-9)


def test_what_no_links_have_becomes_the_nearest_that_can_exist(arm, calibration):
    links = calibration.body.links.copy()
    links[5, 6] = -0.05  # the last link's inertia about its axis
    impossible = replace(calibration, body=replace(calibration.body, links=links))
    possible = possible_links(arm.chain, impossible)
    assert not possible.exact
    assert possible.off > 1.0
    assert all(InertialParameters(theta).is_physical for theta in possible.links)
    ((_, text),) = arm_urdf(arm, impossible, possible, "a test").items()
    assert "No physically possible links" in text
    assert f"{possible.off:.2f} standard deviations" in " ".join(text.split())


def test_the_command_writes_the_arm_of_a_calibration(arm, calibration, tmp_path):
    file = tmp_path / "arm.calibration.toml"
    write_calibration(file, calibration)
    words = ["export", "prbt", str(file), "--output", str(tmp_path / "arm.urdf"), "--format"]
    refused = CliRunner().invoke(app, [*words, "c"], env={"COLUMNS": "300"})
    assert "is an arm's calibration: expected mjcf or urdf" in str(refused.exception)
    done = CliRunner().invoke(app, [*words, "urdf"])
    assert done.exit_code == 0, done.output
    text = (tmp_path / "arm.urdf").read_text()
    model = pin.buildModelFromXML(text)
    assert list(model.names)[1:] == list(arm.joint_names)
    np.testing.assert_allclose(model.upperPositionLimit, arm.limits.motion.position_max_rad)
    np.testing.assert_allclose(model.effortLimit, arm.limits.torque_max_nm)
    assert 'friction="0.0"' in text  # noise had left -0.1 on the last joint
