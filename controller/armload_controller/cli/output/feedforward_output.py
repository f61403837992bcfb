"""A trial of the torque offset, and following errors without and with feed-forward, on the console and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.session.feedforward_comparison import FollowingComparison
    from armload_identification.result_table import ResultTable


def show_comparisons(screen: Screen, comparisons: Sequence[FollowingComparison], robot: str, picture: Path) -> None:
    """Show comparisons as tables, and draw them."""
    from armload_controller.session.comparison_figure import draw

    for comparison in comparisons:
        screen.result_table(following_error_table(comparison))
    draw(comparisons, robot, picture)
    screen.step(f"picture: {picture}")


def offset_account(verdict: OffsetVerdict) -> str:
    """The result of the torque offset check, in one line."""
    used = [
        f"{name} {100 * gain:.0f} %"
        for name, gain, usable in zip(verdict.joint_names, verdict.gain, verdict.usable, strict=True)
        if usable
    ]
    left = [name for name, usable in zip(verdict.joint_names, verdict.usable, strict=True) if not usable]
    text = f"torque offset trial at standstill, response: {', '.join(used)}"
    why = "the weight is too small, or the response is uneven"
    return text + (f"; no torque can be added on {', '.join(left)}: {why}" if left else "")


def following_error_table(comparison: FollowingComparison) -> ResultTable:
    """RMS of the error per joint, and its reduction by feed-forward."""
    from armload_controller.session.feedforward_comparison import Measure
    from armload_identification.result_table import ResultTable

    rows = [
        (
            f"{name} *" if i in comparison.gravity_loaded else name,
            f"{comparison.weight_nm[i]:.1f}",
            f"{1e3 * comparison.without_rms_rad[i]:.3f}",
            *(comparison.less(label, i, 1) for label in comparison.with_rad),
        )
        for i, name in enumerate(comparison.joint_names)
    ]
    below = "* carries the payload's weight"
    if comparison.measure is Measure.TORQUES:
        below += (
            ". The part that follows from the commanded motion alone, the servo's lag, is subtracted from every run; "
            "the rest is due to torque (weight, inertia, friction) and cycle jitter"
        )
    what = comparison.measure
    headings = ("joint", "weight N m", "without mrad", *comparison.with_rad)
    return ResultTable(f"{what[0].upper()}{what[1:]}, RMS over time", headings, rows, (0,), (below,))
