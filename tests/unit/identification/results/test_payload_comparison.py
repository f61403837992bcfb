"""A payload against CAD as a table and as a document."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.model.payload import InertialParameters
from armload_identification.results.payload_comparison import PayloadComparison
from armload_identification.verdict.agreement import Outcome, compare_known
from armload_identification.verdict.cad_comparison import compare_with_cad
from armload_identification.verdict.payload_verdict import known_payload
from armload_identification.verdict.tolerance import Tolerance

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def compared(make_subject):
    """Compare a payload that is `times` as heavy as CAD's, with its iyz unknown."""
    cad = make_subject().payload

    def compared(times=1.0, *, with_calibration=False):
        center, inertia = cad.model.center_of_mass_m, cad.model.inertia_about_com
        body = InertialParameters.from_center_of_mass(times * cad.model.mass_kg, center, inertia)
        known = np.arange(10) != 9
        interval = np.where(known[:, None], body.values[:, None] + np.array([-1e-4, 1e-4]), np.nan)
        payload = replace(cad, model=body, determined=known, interval_95=interval)
        judged = known_payload(payload)
        agreement = compare_known(judged, known_payload(cad), Tolerance())
        corrected = (judged, "arm.calibration.toml") if with_calibration else None
        return PayloadComparison(compare_with_cad(payload, cad), agreement, corrected)

    return compared


@pytest.mark.parametrize(("times", "outcome"), [(1.0, Outcome.RIGHT), (1.5, Outcome.WRONG)])
def test_the_verdict_is_loud_only_if_the_payload_is_not_right(compared, times, outcome):
    found = compared(times)
    assert found.outcome is outcome
    (words,) = [line.partition(": ")[2] for line in found.table().sentences if line.startswith("verdict: ")]
    assert words.isupper() is (outcome is not Outcome.RIGHT)


def test_the_table_has_percents_and_says_what_is_not_determined(compared):
    table = compared(1.5).table()
    assert table.title == "Payload in the flange frame against CAD, as Chen 2016, Table 2"
    assert table.rows[0] == ("m", "2.7000", "4.0500", "50.00 %", "kg")
    assert table.rows[1] == ("c_x", "0.0310", "0.0310", "0.00 %", "m")
    assert table.rows[9][0::2] == ("I_yz", "not determined", "kg m2")
    assert table.rows[9][3] == ""
    assert [table.headings[column] for column in table.text_columns] == ["parameter", "unit"]
    assert not any("with the gains of" in line for line in table.sentences)


def test_values_with_calibrated_gains_are_told_with_the_calibrations_name(compared):
    lines = compared(with_calibration=True).table().sentences
    assert lines[1] == "with the gains of arm.calibration.toml: 2.7000 kg at 0.0310 -0.0120 0.0940 m"


def test_the_document_has_no_number_where_nothing_is_determined(compared):
    document = compared(1.5).to_dict()
    assert document["frame"] == "flange"
    assert document["parameters"]["mass"] == {
        "cad": pytest.approx(2.7),
        "estimate": pytest.approx(4.05),
        "error": pytest.approx(0.5),
    }
    assert document["parameters"]["iyz"]["cad"] is not None
    assert document["parameters"]["iyz"]["estimate"] is document["parameters"]["iyz"]["error"] is None
