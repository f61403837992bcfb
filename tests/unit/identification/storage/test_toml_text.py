"""The text of TOML values, as Python's own parser reads them."""

import tomllib

import numpy as np
import pytest

from armload_identification.storage import toml_text

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("content", "read"),
    [
        ("plain", "plain"),
        ('a "quoted" \\ line\n\x7f\x01 é', 'a "quoted" \\ line\n\x7f\x01 é'),
        (True, True),
        (False, False),
        (3, 3),
        (np.int64(-4), -4),
        (0.1 + 0.2, 0.1 + 0.2),
        (np.float32(0.5), 0.5),
        (1e300, 1e300),
        (float("inf"), float("inf")),
        (["a", "b"], ["a", "b"]),
        ([], []),
        ({'"a b"': 1, "c": "d"}, {"a b": 1, "c": "d"}),
        ([1, 2.5], [1.0, 2.5]),
        (np.array([1.0, -0.0]), [1.0, -0.0]),
        (np.eye(2), [[1.0, 0.0], [0.0, 1.0]]),
        ([[1.0], [2.0, 3.0], []], [[1.0], [2.0, 3.0], []]),
    ],
    ids=str,
)
def test_every_value_is_read_back(content, read):
    found = tomllib.loads(f"key = {toml_text.value(content)}")["key"]
    assert found == read
    assert type(found) is type(read)


def test_a_list_has_one_line_and_a_matrix_one_per_row():
    assert toml_text.value([1.0, 2.0]) == "[1.0, 2.0]"
    assert toml_text.value(np.eye(2)).splitlines() == ["[", "    [1.0, 0.0],", "    [0.0, 1.0],", "]"]


def test_a_table_has_its_values_in_order_and_ends_with_an_empty_line():
    lines = toml_text.table("a.b", {"z": 1, "y": "x"})
    assert lines == ["[a.b]", "z = 1", 'y = "x"', ""]
    twice = "\n".join(toml_text.table("[joint]", {"n": 1}) + toml_text.table("[joint]", {"n": 2}))
    assert tomllib.loads(twice) == {"joint": [{"n": 1}, {"n": 2}]}
    assert toml_text.inline({"a": "1", '"b c"': "[2.0]"}) == '{ a = 1, "b c" = [2.0] }'
