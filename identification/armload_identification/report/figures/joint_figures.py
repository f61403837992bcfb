"""The figures of the report: the motion, and measured against predicted torque, one figure per joint.

In grey the lines differ by width and dashes.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from armload_identification.float_array import FloatArray
from armload_identification.report.figures.figure_style import (
    BLUE,
    GREEN,
    INK,
    NARROW_IN,
    VERMILION,
    WIDE_IN,
    styled_figure,
)
from armload_identification.report.figures.svg import inline_svg
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import Motion

RAW: Final = "#b9c4cc"
SMOOTHED, PREDICTED, RESIDUAL = BLUE, VERMILION, GREEN
COLORS: Final = {"ink": INK, "raw": RAW, "smoothed": SMOOTHED, "predicted": PREDICTED, "residual": RESIDUAL}
"""For the legend, which is part of the page."""
PREDICTED_DASHES: Final = (5.0, 1.5)
_BINS: Final = 600
"""Longer series are drawn as the minimum and maximum of this many segments, which is the resolution of the page."""
_LEFT_IN: Final = 0.52
_RIGHT_IN: Final = 0.06


def motion_figure(run: Motion, joint: int, name: str, title: str) -> str:
    """Position and velocity of a joint over the motion.

    Args:
        run: The motion.
        joint: Joint, from 0.
        name: Id, unique on the page.
        title: Description of the figure.

    Returns:
        An `svg` element.
    """
    with styled_figure(NARROW_IN, 1.95) as figure:
        upper, lower = _stacked(figure, (0.34, 0.60, 0.25, 0.60))
        for axes, values, label in (
            (upper, run.states.position_rad, "position, rad"),
            (lower, run.states.velocity_rad_s, "velocity, rad/s"),
        ):
            axes.plot(*thin_out(run.time_s, values[:, joint]), color=SMOOTHED)
            _value_axis(axes, label, 3)
        _time_axis(upper, lower, run)
        return inline_svg(figure, name, title)


def torque_figure(signal: LoadSignal, predicted_nm: FloatArray, joint: int, name: str, title: str) -> str:
    """Measured against predicted payload torque of a joint, and the residual below.

    The dashed lines of the residual are at two standard deviations of the noise in the raw curve.

    Args:
        predicted_nm: (K, n) predicted difference.
        joint: Joint, from 0.
        name: Id, unique on the page.
        title: Description of the figure.

    Returns:
        An `svg` element.
    """
    time_s, predicted = signal.loaded.time_s, predicted_nm[:, joint]
    raw, smoothed = (np.where(signal.valid, values[:, joint], np.nan) for values in (signal.raw_nm, signal.torque_nm))
    with styled_figure(WIDE_IN, 2.25) as figure:
        upper, lower = _stacked(figure, (0.34, 0.60, 0.25, 0.91))
        upper.plot(*thin_out(time_s, raw), color=RAW, linewidth=0.6)
        upper.plot(*thin_out(time_s, smoothed), color=SMOOTHED, linewidth=0.9)
        upper.plot(*thin_out(time_s, predicted), color=PREDICTED, linewidth=1.5, linestyle=(0.0, PREDICTED_DASHES))
        _value_axis(upper, "payload torque, N m", 5)
        lower.plot(*thin_out(time_s, raw - predicted), color=RAW, linewidth=0.6)
        lower.plot(*thin_out(time_s, smoothed - predicted), color=RESIDUAL, linewidth=0.8)
        for side in (-2.0, 2.0):
            lower.axhline(side * signal.averaged_noise_nm[joint], color=INK, linewidth=0.6, dashes=(2.0, 2.0))
        _value_axis(lower, "measured minus predicted, N m", 4)
        _time_axis(upper, lower, signal.loaded)
        return inline_svg(figure, name, title)


def thin_out(time_s: FloatArray, values: FloatArray, bins: int = _BINS) -> tuple[FloatArray, FloatArray]:
    """The minimum and maximum sample of each segment, in their order.

    No peak is lost, unlike with every k-th sample.

    Args:
        time_s: (K,) times.
        values: (K,) values; nan where there is none.
        bins: Number of segments.

    Returns:
        Times and values: all if there are at most two per segment, else two per segment; nan if a segment has none.
    """
    if values.size <= 2 * bins:
        return time_s, values
    width = -(-values.size // bins)
    padded = np.pad(values, (0, -values.size % width), constant_values=np.nan).reshape(-1, width)
    least = np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1)
    greatest = np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    within = np.sort(np.stack([least, greatest], axis=1), axis=1)
    kept = np.unique(within + width * np.arange(len(padded))[:, None])
    return time_s[kept], values[kept]


def _stacked(figure: Figure, heights_in: tuple[float, float, float, float]) -> tuple[Axes, Axes]:
    """Two axes above each other; heights from below: margin, lower axes, margin, upper axes."""
    wide, high = figure.get_size_inches()
    room, lower, between, upper = heights_in
    left, width = _LEFT_IN / wide, (wide - _LEFT_IN - _RIGHT_IN) / wide
    return (
        figure.add_axes((left, (room + lower + between) / high, width, upper / high)),
        figure.add_axes((left, room / high, width, lower / high)),
    )


def ticks(most: int) -> MaxNLocator:
    """At most this many ticks, at round numbers."""
    return MaxNLocator(most, steps=[1, 2, 2.5, 5, 10])


def _value_axis(axes: Axes, label: str, most: int) -> None:
    """Quantity and unit as horizontal text above the axis; at most so many ticks, without offset or exponent."""
    axes.yaxis.set_major_locator(ticks(most))
    axes.set_title(label, loc="left", fontsize=7.5, pad=3.0)
    axes.ticklabel_format(style="plain", useOffset=False)


def _time_axis(upper: Axes, lower: Axes, run: Motion) -> None:
    """One time axis for both."""
    end_s = run.time_s[-1] + (run.interval_s if run.periodic else 0.0)
    for axes in (upper, lower):
        axes.set_xlim(0.0, end_s)
        axes.xaxis.set_major_locator(ticks(10 if upper.get_position().width > 0.9 else 5))
    upper.tick_params(labelbottom=False, bottom=False)
    lower.set_xlabel("time in the period, s" if run.periodic else "time, s", labelpad=2.0)
