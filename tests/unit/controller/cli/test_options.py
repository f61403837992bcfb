"""Times, shares and ranges as options state them."""

import pytest
import typer

from armload_controller.cli.options import duration_s, ends_of, share, time_s

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("10", 10.0),
        ("10s", 10.0),
        (" 1.5min ", 90.0),
        ("500 ms", 0.5),
        ("2h", 7200.0),
        (".5h", 1800.0),
        ("0", 0.0),
        ("3.s", 3.0),
    ],
)
def test_times_have_a_unit_or_are_in_seconds(text, seconds):
    assert time_s(text) == pytest.approx(seconds)
    if seconds:
        assert duration_s(text) == time_s(text)


@pytest.mark.parametrize("text", ["", "s", "-1s", "1d", "1 2", "1s2", "nan", "1e3"])
def test_what_is_no_time_is_refused(text):
    with pytest.raises(typer.BadParameter, match="is not a time; write 10s"):
        time_s(text)


def test_a_duration_is_above_zero():
    with pytest.raises(typer.BadParameter, match="above zero"):
        duration_s("0ms")


@pytest.mark.parametrize(("text", "value"), [("3%", 0.03), ("0.03", 0.03), ("120 %", 1.2), ("3% ", 0.03), ("2", 2.0)])
def test_shares_are_percents_or_numbers(text, value):
    assert share(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["0", "0%", "-3%", "", "%", "nan", "3%x", "3%%", "much"])
def test_what_is_no_share_is_refused(text):
    with pytest.raises(typer.BadParameter, match=r"expected a share such as 3% or 0\.03"):
        share(text)


@pytest.mark.parametrize(
    ("text", "ends"),
    [("1..3", [1.0, 3.0]), ("1.5 .. 3kg", [1.5, 3.0]), ("2.1kg", [2.1]), ("-1..1", [-1.0, 1.0])]
    + [(text, []) for text in ("", "much", "1...3", "1..", "1..3 g")],
)
def test_a_range_has_two_ends_a_number_one_and_text_none(text, ends):
    assert ends_of(text, "kg") == ends
