"""The picture of a comparison: which formats, and what is drawn in which place."""

from pathlib import Path

import numpy as np
import pytest

from armload_controller.control_errors import CommissioningError
from armload_controller.session import comparison_figure
from armload_controller.session.comparison_figure import draw, require_picture
from armload_controller.session.feedforward_comparison import FollowingComparison, Measure

PHASE_S = np.array([0.0, 0.5, 1.0])
WITHOUT_RAD = np.array([[1e-3, 2e-3], [-1e-3, -2e-3], [1e-3, 2e-3]])
WITH_RAD = {"payload": 0.25 * WITHOUT_RAD, "payload and arm": 1.5 * WITHOUT_RAD}


@pytest.mark.parametrize("name", ["ff.svg", "ff.PNG"])
def test_two_formats_are_pictures(name):
    require_picture(Path(name))


@pytest.mark.parametrize("name", ["ff.pdf", "ff", "svg"])
def test_any_other_is_refused_by_name(name):
    with pytest.raises(CommissioningError) as caught:
        require_picture(Path(name))
    assert str(caught.value) == f"{name}: pictures are written as .svg or .png"
    with pytest.raises(CommissioningError):
        draw([], "arm", Path(name))


def test_a_column_per_comparison_and_a_row_per_joint_in_milliradians(monkeypatch):
    drawn = []
    monkeypatch.setattr(comparison_figure, "write_figure", lambda path, figure: drawn.append((path, figure)))
    names = ("base", "elbow")
    comparisons = [
        FollowingComparison(measure, names, PHASE_S, WITHOUT_RAD, WITH_RAD, np.ones(2)) for measure in Measure
    ]
    draw(comparisons, "er50", Path("ff.svg"))
    ((path, figure),) = drawn
    assert path == Path("ff.svg")
    assert figure.get_suptitle() == "er50: without and with feed-forward"
    assert figure.get_size_inches().tolist() == pytest.approx([18.0, 3.8])
    axes = np.array(figure.axes).reshape(2, 2)
    assert [axis.get_title() for axis in axes[0]] == [str(measure) for measure in Measure]
    assert [axis.get_ylabel() for axis in axes[:, 0]] == ["base\nmrad", "elbow\nmrad"]
    assert [axis.get_xlabel() for axis in axes.flat] == ["", "", *["phase of the path, s"] * 2]
    for row, size_mrad in ((0, 1.0), (1, 2.0)):
        lines = axes[row, 1].get_lines()
        assert [line.get_label() for line in lines] == ["without", "payload: 75 % less", "payload and arm: 50 % more"]
        for line, share in zip(lines, (1.0, 0.25, 1.5), strict=True):
            np.testing.assert_array_equal(line.get_xdata(), PHASE_S)
            np.testing.assert_allclose(line.get_ydata(), share * size_mrad * np.array([1.0, -1.0, 1.0]))
        assert len({line.get_color() for line in lines}) == 3
        assert axes[row, 1].get_legend() is not None
