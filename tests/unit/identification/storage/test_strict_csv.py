"""Strict tables in CSV: header, lines, numbers, and one sentence for what is wrong."""

import pytest

from armload_identification.identification_errors import RunTableError
from armload_identification.storage.strict_csv import parse_csv

pytestmark = pytest.mark.pure


def parsed(text, required=("recording",), optional=("mounting", "mass_kg")):
    return parse_csv(text, "runs.csv", required, optional, "one row per run", RunTableError)


def test_lines_are_named_by_the_header_and_numbered_as_in_the_file():
    lines = parsed("recording, mass_kg\n\n# a remark\na.csv, 2.5\n , \nb.csv\n")
    assert [(line.number, line.text) for line in lines] == [
        (4, {"recording": "a.csv", "mounting": "", "mass_kg": "2.5"}),
        (6, {"recording": "b.csv", "mounting": "", "mass_kg": ""}),
    ]


def test_quoted_fields_may_contain_commas():
    (line,) = parsed('recording,mounting\n"a,b.csv", "big box"\n')
    assert line.text == {"recording": "a,b.csv", "mounting": "big box", "mass_kg": ""}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1, recording.*the header must name recording"),
        ("recording\n", "the table has no rows; expected one row per run"),
        ("recording\n#\n,\n", "the table has no rows"),
        ("mounting\na\n", "line 1, recording is missing: the header must name recording"),
        ("recording,mass\na,1\n", "line 1, column 2 is 'mass': .*; the nearest is 'mass_kg'"),
        ("recording,xyzzy\na,1\n", r"line 1, column 2 is 'xyzzy': expected one of the columns .*mass_kg$"),
        ("recording,recording\na,b\n", r"line 1, column 2 is 'recording': .* once$"),
        ("recording;mass_kg\na;1\n", "separated by semicolons; expected commas"),
        ("recording\tmass_kg\na\t1\n", "separated by tabs; expected commas"),
        ("recording,mass_kg\na,1,2\n", "line 2 is 'a,1,2': expected 2 columns"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(text, said):
    with pytest.raises(RunTableError, match=said):
        parsed(text)


@pytest.mark.parametrize(("text", "value"), [("2.5", 2.5), ("1e-3", 0.001), ("", None)])
def test_a_positive_number_or_nothing(text, value):
    (line,) = parsed(f"recording,mass_kg\na,{text}\n")
    assert line.positive("mass_kg") == value


@pytest.mark.parametrize("text", ["0", "-1", "inf", "nan", "heavy"])
def test_other_numbers_are_refused(text):
    (line,) = parsed(f"recording,mass_kg\na,{text}\n")
    with pytest.raises(RunTableError, match=f"runs.csv: line 2, mass_kg is '{text}': expected a number above 0"):
        line.positive("mass_kg")
