"""The benchmark of modified recordings: notes that say nothing wrong are known by their beginnings."""

from pathlib import Path

import pytest

from armload_identification.pipeline import operator_notes
from benchmarks.accuracy.modified_recordings import QUIET


@pytest.mark.parametrize("beginning", QUIET)
def test_a_quiet_note_is_one_that_an_identification_makes(beginning):
    assert f'"{beginning}' in Path(operator_notes.__file__).read_text("utf-8")
