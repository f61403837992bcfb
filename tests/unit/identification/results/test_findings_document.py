"""Findings as a document of JSON's own types."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.model.payload import InertialParameters, Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.report.reported_payload import ReportedPayload
from armload_identification.results.findings_document import findings_document

pytestmark = pytest.mark.pure


def document(found):
    arm = SimpleNamespace(name="arm", joint_names=tuple(f"j{i}" for i in range(6)))
    subject = ReportedPayload(arm, payload_result(found, Provenance("0", "", {})), found)
    made = findings_document(subject)
    return json.loads(json.dumps(made, allow_nan=False))["identification"]


@pytest.fixture(scope="module")
def two_joints(pinocchio_arm):
    """Only two joints of the wrist move."""
    trajectory = pinocchio_arm.trajectory()
    sine, cosine = trajectory.sin_rad.copy(), trajectory.cos_rad.copy()
    sine[[0, 1, 2, 3]], cosine[[0, 1, 2, 3]] = 0.0, 0.0
    held = FourierTrajectory(trajectory.base_frequency_hz, trajectory.offset_rad, sine, cosine)
    pair = [pinocchio_arm.run(held, load, seed=61 + load) for load in (True, False)]
    return identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)


def test_a_motion_that_leaves_directions_undetermined_has_no_condition_number(two_joints):
    found = document(two_joints)
    assert any("parameter directions" in note for note in found["notes"])
    assert found["condition_number"] is None
    assert found["plain_is_possible"] is False


def test_whether_the_plain_estimate_is_possible_is_seen_from_its_margin(pair, pinocchio_arm, two_joints):
    """It is reported unchanged only if its margin is more than rounding and every direction is determined."""
    whole = identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)
    found = document(whole)
    assert found["plain_is_possible"] is True
    assert found["plain_margin"] == pytest.approx(InertialParameters(whole.plain.theta[:10]).margin)
    assert found["plain_margin"] > 0.0
    assert found["condition_number"] == pytest.approx(whole.plain.condition_number)
    # An estimate without any inertia has no margin at all.
    posterior = two_joints.plain.posterior
    nothing = replace(two_joints.plain, posterior=replace(posterior, x=0.0 * posterior.x))
    nowhere = replace(two_joints, plain=nothing)
    assert document(nowhere)["plain_margin"] is None
