"""A payload against CAD, from files or objects, with and without the gains of a calibration."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.analysis.robot_comparison import compare
from armload_identification.files.calibration_file import write_calibration
from armload_identification.files.payload_file import write_payload
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.agreement import Outcome
from armload_identification.verdict.tolerance import Tolerance


@pytest.fixture
def payload(make_subject):
    """A payload of an arm whose gains were 10 N m/A, `times` as heavy as CAD's."""
    cad = make_subject().payload

    def payload(times=1.0, robot="six"):
        body = InertialParameters.from_center_of_mass(
            times * cad.model.mass_kg, cad.model.center_of_mass_m, cad.model.inertia_about_com
        )
        slope = np.zeros((4, 6))
        slope[0] = cad.model.mass_kg / 6.0
        known = MassCenterCovariance(1e-8 * np.eye(4), 100.0, np.full(6, 10.0), slope, 1e-8 * np.eye(6))
        provenance = replace(cad.provenance, robot=robot)
        return replace(cad, model=body, mass_center=known, provenance=provenance)

    return payload


@pytest.mark.parametrize(
    ("times", "mass", "outcome"),
    [(1.01, None, Outcome.RIGHT), (1.01, 0.001, Outcome.WRONG), (1.1, None, Outcome.WRONG)],
)
def test_the_default_tolerance_is_two_percent_of_the_mass(payload, make_subject, times, mass, outcome):
    tolerance = None if mass is None else Tolerance(mass_share=mass)
    found = compare(payload(times), make_subject().payload, tolerance=tolerance)
    assert found.outcome is outcome
    assert found.corrected is None


@pytest.mark.parametrize("as_file", [False, True])
def test_gains_of_a_calibration_are_applied(chosen, payload, make_subject, tmp_path, as_file):
    """Gains are 2 % above those that the payload was identified with, so the mass is 2 % more."""
    write_calibration(tmp_path / "arm.toml", chosen)
    calibration, name = (tmp_path / "arm.toml", "arm.toml") if as_file else (chosen, "the calibration")
    known, told = compare(payload(1.0 / 1.02), make_subject().payload, calibration=calibration).corrected
    assert told == name
    assert known.parameters.mass_kg == pytest.approx(2.7, rel=1e-3)


@pytest.mark.parametrize(("robot", "refused"), [("six", False), ("", False), ("seven", True)])
def test_a_calibration_of_another_arm_is_refused(chosen, payload, make_subject, tmp_path, robot, refused):
    found = payload(robot=robot)
    cad = make_subject().payload
    if not refused:
        assert compare(found, cad, calibration=chosen).outcome is not None
        return
    with pytest.raises(PayloadFileError) as caught:
        compare(found, cad, calibration=chosen)
    assert str(caught.value).startswith("payload: provenance.robot")
    assert str(caught.value).endswith("expected 'six', the arm of the calibration")
    write_payload(tmp_path / "payload.toml", found)
    with pytest.raises(PayloadFileError, match=r"payload\.toml: provenance\.robot"):
        compare(tmp_path / "payload.toml", cad, calibration=chosen)
