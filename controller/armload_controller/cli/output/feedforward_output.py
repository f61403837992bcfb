"""A trial of the torque offset, and following errors without and with feed-forward, on the console and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

    from armload_controller.cli.screen import Screen
    from armload_controller.feedforward.offset_check import OffsetVerdict
    from armload_controller.session.feedforward_comparison import FollowingComparison


def show_comparisons(screen: Screen, comparisons: Sequence[FollowingComparison], robot: str, picture: Path) -> None:
    """Show comparisons as tables, and draw them."""
    from armload_controller.session.comparison_figure import draw

    for comparison in comparisons:
        screen.table(following_error_table(comparison))
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


def following_error_table(comparison: FollowingComparison) -> Table:
    """RMS of the error per joint, and its reduction by feed-forward."""
    from rich.table import Table

    from armload_controller.cli.console_text import right
    from armload_controller.session.feedforward_comparison import Measure

    what = comparison.measure
    headings = right("weight N m", "without mrad", *comparison.with_rad)
    table = Table("joint", *headings, title=f"{what[0].upper()}{what[1:]}, RMS over time", title_justify="left")
    for i, name in enumerate(comparison.joint_names):
        shares = [comparison.less(label, i, 1) for label in comparison.with_rad]
        mark = " *" if i in comparison.gravity_loaded else ""
        weight, before = comparison.weight_nm[i], 1e3 * comparison.without_rms_rad[i]
        table.add_row(name + mark, f"{weight:.1f}", f"{before:.3f}", *shares)
    table.caption = "* carries the payload's weight"
    if comparison.measure is Measure.TORQUES:
        table.caption += (
            ". The part that follows from the commanded motion alone, the servo's lag, is subtracted from every run; "
            "the rest is due to torque (weight, inertia, friction) and cycle jitter"
        )
    return table
