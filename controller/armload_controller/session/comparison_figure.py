"""Figure of comparisons: one column per comparison, one row per joint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from armload_controller.control_errors import CommissioningError
from armload_controller.session.feedforward_comparison import FollowingComparison
from armload_identification.extras import Extra, require_extra
from armload_identification.report.figures.figure_file import write_figure


def require_picture(path: Path) -> None:
    """Refuse a file of another format before anything moves.

    Raises:
        CommissioningError: the ending is neither .svg nor .png.
    """
    require_extra(Extra.REPORT, "the picture of a comparison")
    if path.suffix.lower() not in {".svg", ".png"}:
        raise CommissioningError(f"{path}: pictures are written as .svg or .png")


def draw(comparisons: Sequence[FollowingComparison], robot: str, path: Path) -> None:
    """Draw the errors without and with feed-forward over the phase.

    Args:
        comparisons: The comparisons, all of the same joints.
        robot: Name of the arm.
        path: File ending in .svg or .png; an existing file is replaced.

    Raises:
        CommissioningError: the ending is neither .svg nor .png.
        ReportError: the file cannot be written.
    """
    require_picture(path)
    from matplotlib.figure import Figure

    from armload_identification.report.figures.figure_style import BLUE, GREEN, VERMILION

    n = len(comparisons[0].joint_names)
    figure = Figure(figsize=(9.0 * len(comparisons), 1.5 * n + 0.8), layout="constrained")
    axes = figure.subplots(n, len(comparisons), sharex=True, squeeze=False)
    for column, comparison in enumerate(comparisons):
        for i, name in enumerate(comparison.joint_names):
            axis = axes[i, column]
            axis.plot(comparison.phase_s, 1e3 * comparison.without_rad[:, i], color="#999999", label="without")
            for color, (label, error) in zip((BLUE, GREEN, VERMILION), comparison.with_rad.items(), strict=False):
                text = f"{label}: {comparison.less(label, i, 0)}"
                axis.plot(comparison.phase_s, 1e3 * error[:, i], color=color, lw=0.9, label=text)
            axis.set_ylabel(f"{name}\nmrad", fontsize=8)
            axis.tick_params(labelsize=7)
            axis.grid(alpha=0.3)
            axis.legend(fontsize=7, loc="upper right")
        axes[0, column].set_title(comparison.measure, fontsize=9)
        axes[-1, column].set_xlabel("phase of the path, s")
    figure.suptitle(f"{robot}: without and with feed-forward", fontsize=10)
    write_figure(path, figure)
