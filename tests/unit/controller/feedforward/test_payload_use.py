"""Whether a payload may be given to a controller, and why not."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.feedforward.payload_use import another_arms, why_not_usable
from armload_identification.model.payload import InertialParameters


@pytest.fixture
def payload(make_subject):
    return make_subject().payload


@pytest.fixture
def chain(make_subject):
    return make_subject().chain


def of(payload, **changes):
    return replace(payload, provenance=replace(payload.provenance, **changes))


def test_a_payload_of_this_arm_or_of_an_unknown_one_is_usable(payload, chain):
    for robot, kinematics in (("er50", chain.kinematics_sha256), ("", ""), ("er50", ""), ("", chain.kinematics_sha256)):
        known = of(payload, robot=robot, kinematics_sha256=kinematics)
        assert another_arms(known, chain, "er50") is None
        assert why_not_usable(known, chain, "er50", "exported") is None


def test_a_payload_of_another_arm_or_another_flange_is_not(payload, chain):
    other = of(payload, robot="prbt", kinematics_sha256=chain.kinematics_sha256)
    assert "identified on the robot 'prbt', not on 'er50'" in another_arms(other, chain, "er50")
    moved = of(payload, robot="er50", kinematics_sha256="0" * 64)
    assert "the flange may be elsewhere" in another_arms(moved, chain, "er50")
    assert why_not_usable(moved, chain, "er50", "exported") == another_arms(moved, chain, "er50")


@pytest.mark.parametrize("number", range(10))
def test_mass_and_centre_must_be_determined_and_the_inertia_need_not(payload, chain, number):
    determined = np.arange(10) != number
    reason = why_not_usable(replace(payload, determined=determined), chain, "er50", "fed forward")
    if number < 4:
        assert reason.startswith("not determined: ")
        assert "a payload is fed forward only with its mass" in reason
        assert reason.count(",") == 0
    else:
        assert reason is None


def test_frame_joints_and_body_must_fit(payload, chain):
    assert "in the frame 'tool'" in why_not_usable(replace(payload, frame="tool"), chain, "er50", "exported")
    five = replace(payload, residual_rms_nm=payload.residual_rms_nm[:5])
    assert "identified on 5 joints, but er50 has 6" in why_not_usable(five, chain, "er50", "exported")
    inertia = np.diag([1.0, 0.1, 0.1])
    theta = InertialParameters.from_center_of_mass(2.0, [0.0, 0.0, 0.1], 0.1 * np.eye(3)).theta.copy()
    theta[4:7] = np.diag(inertia)
    impossible = replace(payload, model=InertialParameters(theta))
    assert "no body has these parameters: margin -" in why_not_usable(impossible, chain, "er50", "exported")
