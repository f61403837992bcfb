"""Numbers as they are printed: digits that an interval justifies, signs, and the alignment of a column."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.numerals import (
    NO_BREAK,
    align,
    common_decimals,
    counted,
    decimals_for,
    numeral,
    scientific,
)

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("half_width", "value", "decimals"),
    [
        (0.05, 4.0, 3),
        (0.0996, 4.0, 2),
        (0.0994, 4.0, 3),
        (1.0, 4.0, 1),
        (10.0, 4.0, 0),
        (99.6, 4.0, 0),
        (1e-12, 4.0, 9),
        (0.0, 4.0, 5),
        (np.inf, 0.04, 7),
        (np.nan, 400.0, 3),
        (0.0, 0.0, 0),
        (-1.0, 4.0, 5),
        (np.nan, np.nan, 0),
    ],
)
def test_two_digits_of_the_half_width_are_shown_or_six_of_the_value(half_width, value, decimals):
    assert decimals_for(half_width, value) == decimals


@pytest.mark.parametrize(
    ("value", "decimals", "signed", "text"),
    [
        (1.25, 1, False, "1.2"),
        (-1.26, 1, False, "\N{MINUS SIGN}1.3"),
        (1.26, 1, True, "+1.3"),
        (-0.04, 1, False, "0.0"),
        (0.04, 1, True, "0.0"),
        (0.0, 0, True, "0"),
        (10.0, 0, False, "10"),
        (100.0, 0, True, "+100"),
        (np.nan, 2, True, "unknown"),
        (np.inf, 2, False, "\N{INFINITY}"),
        (-np.inf, 2, False, "\N{MINUS SIGN}\N{INFINITY}"),
    ],
)
def test_a_number_has_a_minus_sign_and_zero_has_none(value, decimals, signed, text):
    assert numeral(value, decimals, signed=signed) == text


def test_a_column_is_aligned_at_its_decimal_points():
    """A point is half as wide as a digit."""
    found = align(["1.25", "10", "", "3.5"])
    assert [one.text for one in found] == ["1.25", "10", "", "3.5"]
    assert [one.pad_ch for one in found] == [0.0, 2.5, 2.5, 1.0]
    assert align([]) == ()
    assert [one.pad_ch for one in align(["10", "3"])] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("values", "digits", "decimals"),
    [([0.5, 0.25], 3, 3), ([12.0, 0.1], 3, 1), ([1e4, 1.0], 3, 0), ([np.nan, np.inf, 0.02], 2, 3), ([0.0], 3, 0)],
)
def test_the_greatest_number_of_a_column_sets_its_decimals(values, digits, decimals):
    assert common_decimals(values, digits) == decimals
    assert common_decimals([-value for value in values], digits) == decimals


@pytest.mark.parametrize(
    ("value", "text"),
    [(12345.0, ("1.2", "4")), (-0.00123, ("\N{MINUS SIGN}1.2", "\N{MINUS SIGN}3")), (np.inf, ("\N{INFINITY}", ""))],
)
def test_a_number_has_a_mantissa_and_a_power_of_ten(value, text):
    assert scientific(value) == text


def test_things_are_counted():
    assert [counted(count, "arm") for count in (0, 1, 2)] == ["0 arms", "1 arm", "2 arms"]
    assert NO_BREAK == "\xa0"
