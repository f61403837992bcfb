"""Arguments of another type than expected get one sentence."""

from pathlib import Path

import pytest

from armload_identification.argument_types import path_of, require_type, wrong_type

pytestmark = pytest.mark.pure


def test_a_path_is_a_text_or_a_path():
    assert path_of("path", "a.csv") == path_of("path", Path("a.csv")) == Path("a.csv")
    with pytest.raises(TypeError, match=r"`path=` is 3 \(int\): expected a path\."):
        path_of("path", 3)


def test_an_optional_argument_is_none_or_of_its_type():
    require_type("known", None, Path)
    require_type("known", Path(), Path)
    with pytest.raises(TypeError, match=r"`known=` is 'x' \(str\): expected armload\.Path\."):
        require_type("known", "x", Path)


def test_a_long_value_is_cut():
    assert len(str(wrong_type("a", "x" * 1000, "b"))) < 150
