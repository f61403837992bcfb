"""The comparison as a picture: what the payload does to the following error, joint by joint."""

from __future__ import annotations

from pathlib import Path

from armload_controller.comparison import Comparison
from armload_controller.errors import CommissioningError

COLORS = ("#0072b2", "#009e73")
"""Told apart by those who do not see red and green."""


def require_picture(path: Path) -> None:
    """Refuse a file that no picture can be drawn into, before anything moves.

    Raises:
        CommissioningError: another ending than .svg or .png.
    """
    if path.suffix.lower() not in {".svg", ".png"}:
        raise CommissioningError(f"{path}: pictures are written as .svg or .png")


def draw(comparison: Comparison, robot: str, path: Path) -> None:
    """Draw the errors without and with feed-forward over the phase.

    Args:
        comparison: What to draw.
        robot: Name of the arm.
        path: SVG or PNG file, after its ending; an existing file is replaced.

    Raises:
        CommissioningError: another ending, or the file cannot be written.
    """
    require_picture(path)
    from matplotlib.figure import Figure

    n = len(comparison.joint_names)
    figure = Figure(figsize=(9.0, 1.5 * n + 0.8), layout="constrained")
    axes = figure.subplots(n, 1, sharex=True, squeeze=False)[:, 0]
    for i, (axis, name) in enumerate(zip(axes, comparison.joint_names, strict=True)):
        axis.plot(comparison.phase_s, 1e3 * comparison.without_rad[:, i], color="#999999", label="without feed-forward")
        for color, (label, error) in zip(COLORS, comparison.with_rad.items(), strict=False):
            share = 100 * comparison.reduction(label)[i]
            axis.plot(
                comparison.phase_s, 1e3 * error[:, i], color=color, lw=0.9, label=f"with, {label}: {share:.0f} % less"
            )
        axis.set_ylabel(f"{name}\nmrad", fontsize=8)
        axis.tick_params(labelsize=7)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7, loc="upper right")
    axes[-1].set_xlabel("phase of the path, s")
    what = "what the payload adds to the following error" if comparison.empty_known else "following error"
    figure.suptitle(f"{robot}: {what}, without and with feed-forward", fontsize=10)
    try:
        figure.savefig(path, dpi=130)
    except OSError as error:
        raise CommissioningError(f"{path}: {error.strerror}: choose a file that can be written") from error
