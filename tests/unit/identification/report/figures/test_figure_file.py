"""Figures as files: the formats that there are."""

import pytest
from matplotlib.figure import Figure

from armload_identification.identification_errors import ReportError
from armload_identification.report.figures.figure_file import write_figure


@pytest.mark.parametrize("name", ["x.toml", "x"])
def test_a_picture_of_no_format_is_refused_with_the_formats_there_are(tmp_path, name):
    with pytest.raises(ReportError, match=rf"{name}: .* expected one of .*pdf, .*png, .*svg"):
        write_figure(tmp_path / name, Figure())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["x.svg", "x.png"])
def test_a_picture_has_the_format_of_its_suffix(tmp_path, name):
    write_figure(tmp_path / name, Figure(figsize=(2.0, 1.0)))
    start = (tmp_path / name).read_bytes()[:8]
    assert start == (b"<?xml ve" if name == "x.svg" else b"\x89PNG\r\n\x1a\n")
