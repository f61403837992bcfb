"""The result for a reader: digits that the intervals justify, what is not determined, and errors in simulation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.model.payload import InertialParameters
from armload_identification.report.payload_in_words import (
    compared_rows,
    half_widths,
    headline,
    mass_card,
    parameter_rows,
    truth_sentence,
)

pytestmark = pytest.mark.pure

BODY = InertialParameters.from_center_of_mass(2.0, [0.1, 0.02, -0.05], np.diag([0.03, 0.02, 0.01]))
WIDTHS = np.array([0.05, 0.002, 0.003, 0.004, *[0.002] * 6])
TRUTH = InertialParameters.from_center_of_mass(2.04, [0.101, 0.024, -0.05], np.diag([0.031, 0.02, 0.01]))


def payload(undetermined=(), body=BODY):
    values = body.values
    interval = np.column_stack([values - WIDTHS, values + WIDTHS])
    known = ~np.isin(np.arange(10), undetermined)
    interval[~known] = np.nan
    return SimpleNamespace(
        values=values, interval_95=interval, determined=known, frame="flange", model=SimpleNamespace(mass_kg=2.0)
    )


def plain(text):
    return text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{MINUS SIGN}", "-")


def test_the_mass_has_two_digits_of_its_half_width():
    assert [plain(part) for part in mass_card(payload())] == ["2.000 kg", "1.950 to 2.050 kg"]
    assert mass_card(payload((0,))) is None
    np.testing.assert_allclose(half_widths(payload()), WIDTHS)


def test_the_headline_has_the_mass_and_the_centre_in_millimetres():
    assert plain(headline(payload())) == (
        "The payload weighs 2.000 kg (1.950 to 2.050 kg). Its centre of mass lies at x = 100.0 mm (98.0 to 102.0 mm), "
        "y = 20.0 mm (17.0 to 23.0 mm) and z = -50.0 mm (-54.0 to -46.0 mm) in the flange frame."
    )


@pytest.mark.parametrize(
    ("undetermined", "said"),
    [
        ((0,), "The mass of the payload is not determined by these data. Its centre of mass lies at x = 100.0 mm"),
        ((3,), "y = 20.0 mm (17.0 to 23.0 mm) in the flange frame. Its position along z is not determined."),
        ((1, 3), "lies at y = 20.0 mm (17.0 to 23.0 mm) in the flange frame. Its position along x and z is not"),
        ((1, 2, 3), "kg). Its centre of mass is not determined."),
    ],
)
def test_what_is_not_determined_is_said(undetermined, said):
    assert said in plain(headline(payload(undetermined)))


@pytest.mark.parametrize(
    ("undetermined", "said"),
    [
        ((), "the mass is -1.96 % off and the centre of mass 4.1 mm."),
        ((0,), "is known exactly: the centre of mass 4.1 mm."),
        ((2,), "is known exactly: the mass is -1.96 % off."),
        ((0, 1), ""),
    ],
)
def test_errors_of_a_simulated_payload_are_of_what_is_determined(undetermined, said):
    found = plain(truth_sentence(payload(undetermined), TRUTH))
    assert said in found
    assert bool(said) is bool(found)


def test_the_table_has_every_parameter_with_its_share_of_the_limit():
    """A fifth of 2 kg, of 0.1 m and of 0.02 kg m2."""
    widths = WIDTHS.copy()
    widths[[2, 9]] = np.nan, 0.008
    rows = parameter_rows(payload((2, 9)), widths, None)
    names = [f"{row['symbol']}{row['index']}" for row in rows]
    assert names == ["m", "cx", "cy", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"]
    assert [row["determined"] for row in rows] == [True, True, False, *[True] * 6, False]
    assert [row["limit_share"] for row in rows] == pytest.approx([0.125, 0.1, None, 0.2, *[0.5] * 5, 2.0])
    assert [(row["truth"], row["error"], row["covered"]) for row in rows] == [(None, "", None)] * 10
    assert [row["estimate"].text for row in rows[:3]] == ["2.000", "0.1000", ""]
    assert [plain(text.text) for text in (rows[3]["low"], rows[3]["high"])] == ["-0.0540", "-0.0460"]
    assert (rows[2]["low"].text, rows[9]["high"].text) == ("", "")


def test_in_simulation_the_table_has_truth_error_and_whether_it_is_covered():
    rows = parameter_rows(payload((1,)), WIDTHS, TRUTH)
    assert [plain(rows[i]["error"]) for i in (0, 1, 2, 4)] == ["-1.96 %", "", "-4.0 mm", "-0.0010 kg m²"]
    assert [rows[i]["covered"] for i in (0, 1, 2, 3, 4)] == [True, None, False, True, True]
    assert rows[0]["truth"].text == "2.0400", "one digit more"
    assert rows[1]["truth"].text == "0.1010", "with the digits of one just determined, and one more"


def test_plain_and_reported_values_are_compared_in_half_widths():
    other = InertialParameters.from_center_of_mass(2.025, [0.099, 0.02, -0.05], np.diag([0.03, 0.02, 0.01]))
    rows = compared_rows(SimpleNamespace(plain_parameters=other), payload((2,)))
    names = [f"{row['symbol']}{row['index']}" for row in rows]
    assert names == ["m", "cx", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz"]
    cells = [[plain(row[name].text) for name in ("plain", "reported", "change")] for row in rows[:2]]
    assert cells == [["2.025", "2.000", "-0.50"], ["0.0990", "0.1000", "+0.50"]]
    assert rows[2]["change"].text == "0.00"
