"""One run of an arm as equations: its motion, its motors' effort, and the columns of the arm's unknowns.

Efforts, and the torque that the model gives for the motion, are averaged over the same window of a third of a second.
The motion itself is hardly filtered, because the torque at the mean position is not the mean torque: with positions and
efforts low-passed at 4 Hz and the model evaluated behind that, the mass of a payload was 0.2 % too low on er50, whose
joints reach 1.7 rad/s; with this window 0.01 %. Whole periods of a known excitation are averaged first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.base_tilt import sideways
from armload_identification.estimation.estimation_constants import Rows
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import PARAMETERS, body_regressor, payload_regressor
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.reversals import REVERSAL, TURN_OVER, moving_weights
from armload_identification.signals.signal_constants import RowMean

NO_ROWS: Final = "no third of a second is without a gap of more than 0.1 s: record it at 20 Hz or more"
"""Why a run has no row."""


@dataclass(frozen=True, eq=False)
class RowWindow:
    """R rows of K equidistant samples: means over a third of a second of measured and of modelled quantities.

    Torque and regressor pass through the same kernel, (1 - u^2)^2. It is the kernel implied by a cubic's second
    derivative, as in the recursive estimator, whose window is shorter to reduce the delay. If only the torque were
    filtered, jerky motion would remain in the model: 10 kg on a simulated arm with elastic joints was then identified
    as 10.6 kg, and with this kernel as 10.1 kg.

    Attributes:
        middle: (R,) index of the sample in the middle of each row.
        offset: (w,) indices of a row's samples relative to its middle.
        interval_s: Time between samples.
        length: K.
        periodic: The last sample is followed by the first.
        half_s: Half of the window.
    """

    middle: NDArray[np.intp]
    offset: NDArray[np.intp]
    interval_s: float
    length: int
    periodic: bool
    half_s: float

    @classmethod
    def of(
        cls, length: int, interval_s: float, step: int, *, periodic: bool = False, half_s: float = RowMean.half_s
    ) -> RowWindow:
        """Rows about every `step`-th of `length` samples; in a periodic run the last is followed by the first."""
        reach = int(half_s / interval_s + Rows.rounding)
        return cls(np.arange(0, length, step), np.arange(-reach, reach + 1), interval_s, length, periodic, half_s)

    def only(self, rows: NDArray[np.bool_]) -> RowWindow:
        """The rows for which (R,) is True."""
        return replace(self, middle=self.middle[rows])

    def every(self, step: int) -> RowWindow:
        """The same rows of every `step`-th sample of their windows, counted from the middle."""
        reach = int(self.offset[-1]) // step
        return replace(self, offset=step * np.arange(-reach, reach + 1))

    @cached_property
    def weight(self) -> FloatArray:
        """(w,) weights of a row's samples, with a sum of 1."""
        weight = (1.0 - self._share**2) ** 2
        return np.asarray(weight / weight.sum())

    def noise(self, memory: FloatArray) -> FloatArray:
        """(L,) covariance of rows of samples with unit variance, by the lag in rows from 0: windows overlap.

        Args:
            memory: (m,) autocorrelation of the samples by their lag from 0.
        """
        step = int(np.diff(self.middle).min()) if self.middle.size > 1 else self.offset.size
        shared = np.correlate(self.weight, self.weight, "full")
        whole = np.convolve(shared, np.concatenate([memory[:0:-1], memory]))
        return np.asarray(whole[whole.size // 2 :: step])

    @cached_property
    def slope_weight(self) -> FloatArray:
        """(w,) weights of a row's samples that give the derivative of its mean, per s; exact for a straight line.

        They are 0 if a row has a single sample.
        """
        slope = self._share * (1.0 - self._share**2)
        rise = np.full_like(slope, slope @ self._share * self.half_s)
        return np.divide(slope, rise, out=np.zeros_like(slope), where=rise > 0.0)

    @property
    def _share(self) -> FloatArray:
        """(w,) u: time from the row's middle as a share of half the window."""
        return np.asarray(self.offset * self.interval_s / self.half_s)

    @cached_property
    def samples(self) -> NDArray[np.intp]:
        """(R, w) indices of each row's samples; beyond either end of the run, of its last one."""
        at = self.middle[:, None] + self.offset
        return np.asarray(at % self.length if self.periodic else np.clip(at, 0, self.length - 1))

    @property
    def whole(self) -> NDArray[np.bool_]:
        """(R,) False at both ends of a run that is not periodic, where the window is incomplete."""
        inside = (self.middle + self.offset[0] >= 0) & (self.middle + self.offset[-1] < self.length)
        return np.asarray(inside | self.periodic)

    def mean(self, values: FloatArray) -> FloatArray:
        """(R, ...) weighted means of (K, ...) values."""
        return weighted_sums(values, self.samples, self.weight)

    def slope(self, values: FloatArray) -> FloatArray:
        """(R, ...) derivatives of the weighted means of (K, ...) values, per s."""
        return weighted_sums(values, self.samples, self.slope_weight)

    def usable(self, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(R,) True for rows with a complete window of samples that are all True in (K,)."""
        return np.asarray(self.whole & (self.mean(np.asarray(~valid, dtype=np.float64)) == 0.0))

    def onward(self, direction: FloatArray) -> FloatArray:
        """(R, n) weights by (K, n) directions, -1 to 1: 1 if a joint keeps its own, 0 if it reverses or stands."""
        return np.asarray(np.maximum((np.abs(self.mean(direction)) - RowMean.onward) / (1.0 - RowMean.onward), 0.0))


def row_window(run: Motion, row_s: float = Rows.row_s, spacing: int = 1) -> RowWindow:
    """The usable rows of a run.

    Args:
        row_s: Time between rows; further in a long run.
        spacing: Keep every `spacing`-th row.
    """
    samples = len(run.time_s)
    row_s = max(row_s, samples * run.interval_s / Rows.most)
    step = max(round(row_s / run.interval_s - Rows.rounding), 1) * spacing
    half_s = RowMean.half_s * min(2.0 * row_s / Rows.row_s, 1.0)
    window = RowWindow.of(samples, run.interval_s, step, periodic=run.periodic, half_s=half_s)
    usable = _without_holes(run.valid, run.interval_s) if run.periodic else run.valid
    return window.only(window.usable(usable))


def close_rows(run: Motion) -> RowWindow:
    """At least a hundred rows of a period, for two runs that are compared phase by phase."""
    length_s = len(run.time_s) * run.interval_s
    return row_window(run, min(Rows.row_s, length_s / Rows.fewest) if run.periodic else Rows.row_s)


def peak_rad_s(run: Motion) -> FloatArray:
    """(n,) greatest speeds, of means over the rows' windows: single samples are greater by their noise."""
    return np.asarray(np.abs(row_window(run).mean(run.states.velocity_rad_s)).max(axis=0, initial=0.0))


@dataclass(frozen=True, eq=False)
class ArmRows:
    """N rows of a run of n joints with b base parameters: means over the rows' windows.

    Attributes:
        time_s: (N,) middle of the row's window, since the start.
        position_rad: (N, n).
        velocity_rad_s: (N, n).
        axis_acceleration_rad_s2: (N, n) C^-1 ddq.
        axis_jerk_rad_s3: (N, n) its change per second of delay of the torque.
        direction: (N, n) direction of motion, -1 to 1.
        root: (N, n) direction times sqrt|dq|.
        effort_nm: (N, n) axis torque with nominal gains.
        weight: (N, n) 0 where the joint turns or stands within the window, 1 far from that. Near a reversal no friction
            model is accurate: on prbt, residuals of such rows made runs contradict each other. The difference of two
            runs is no better there: the torque changes faster than it is sampled, which looks like inertia.
        links: (N, n, b) joint torque per base parameter of the links.
        links_moved: (N, 3, n, b) its change per second of delay, and per rad of each tilt of the base.
        payload: (N, n, 10) joint torque per parameter of a payload.
        payload_moved: (N, 3, n, 10) likewise.
    """

    time_s: FloatArray
    position_rad: FloatArray
    velocity_rad_s: FloatArray
    axis_acceleration_rad_s2: FloatArray
    axis_jerk_rad_s3: FloatArray
    direction: FloatArray
    root: FloatArray
    effort_nm: FloatArray
    weight: FloatArray
    links: FloatArray
    links_moved: FloatArray
    payload: FloatArray
    payload_moved: FloatArray

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.effort_nm.shape[1])

    def only(self, kept: NDArray[np.bool_]) -> ArmRows:
        """Some of the rows.

        Args:
            kept: (N,) True for these.
        """
        return ArmRows(*(getattr(self, part.name)[kept] for part in fields(self)))

    def weighted(self, factor: NDArray[Any]) -> ArmRows:
        """The rows with their weights times an (n,) factor."""
        return replace(self, weight=self.weight * factor)


def motion_with_rows(run: Run) -> Motion:
    """Motion of a run: its average period if it has whole ones, else the part in which the arm moves.

    Raises:
        RecordingError: too short.
    """
    motion = run.motion
    length_s = len(motion.time_s) * motion.interval_s
    if not motion.periodic and length_s < Rows.shortest_s:
        raise RecordingError(
            f"{run.recording.source.path}: {length_s:.1f} s of motion, expected {Rows.shortest_s:g} s or more. Record "
            "a whole excitation."
        )
    return replace(motion, valid=motion.valid & (motion.interval_s <= Rows.hole_s))


def _without_holes(valid: NDArray[np.bool_], interval_s: float) -> NDArray[np.bool_]:
    """(K,) False in holes of a period; single phases without a sample, whose values are interpolated, are none."""
    known = np.flatnonzero(valid)
    phase = np.arange(valid.size)
    before = np.concatenate([known[-1:] - valid.size, known])[np.searchsorted(known, phase, side="right")]
    after = np.concatenate([known, known[:1] + valid.size])[np.searchsorted(known, phase)]
    return np.asarray((after - before) * interval_s <= Rows.hole_s + Rows.rounding_s)


@dataclass(frozen=True, eq=False)
class ArmLayout:
    """An arm of n joints whose runs become rows.

    Attributes:
        chain: The arm as configured, without tilt.
        coupling: (n, n) C of its motors.
        base: (10 n,) True for the base parameters of the links.
        peak_rad_s: (n,) greatest speed of each joint over all runs.
    """

    chain: Chain
    coupling: FloatArray
    base: NDArray[np.bool_]
    peak_rad_s: FloatArray

    @classmethod
    def of(cls, runs: Sequence[Motion], chain: Chain, coupling: FloatArray) -> ArmLayout:
        """The arm, with the speeds of these runs."""
        base = base_columns(chain, coupling)[: PARAMETERS * chain.n]
        return cls(chain, coupling, base, np.max([peak_rad_s(run) for run in runs], axis=0))

    def rows(self, run: Motion, *, loaded: bool, window: RowWindow | None = None) -> ArmRows:
        """The equations of a run, of all rows or those of a window; with a payload's columns if `loaded`."""
        states, moves = run.states, self.peak_rad_s > Rows.stands_rad_s
        scale = np.where(moves, self.peak_rad_s, 1.0)
        sign = np.where(moves, np.tanh(states.velocity_rad_s / (TURN_OVER * scale)), 0.0)
        window = window or row_window(run)
        velocity = window.mean(states.velocity_rad_s)
        acceleration = states.acceleration_rad_s2 @ np.linalg.inv(self.coupling).T
        coarse = window.every(max(int(window.half_s / (Rows.model_parts * run.interval_s) + Rows.rounding), 1))
        links, links_moved = _columns(self.chain, coarse, states, lambda *at: body_regressor(*at)[:, :, self.base])
        payload, payload_moved = np.zeros((*velocity.shape, 0)), np.zeros((len(velocity), 3, self.chain.n, 0))
        if loaded:
            payload, payload_moved = _columns(self.chain, coarse, states, payload_regressor)
        return ArmRows(
            time_s=np.asarray(window.middle * run.interval_s, dtype=np.float64),
            position_rad=window.mean(states.position_rad),
            velocity_rad_s=velocity,
            axis_acceleration_rad_s2=window.mean(acceleration),
            axis_jerk_rad_s3=-window.slope(acceleration),
            direction=window.mean(sign),
            root=window.mean(sign * np.sqrt(np.abs(states.velocity_rad_s))),
            effort_nm=window.mean(run.raw_nm) @ self.coupling,
            weight=np.where(moves, window.onward(sign) * moving_weights(velocity, REVERSAL * scale), 0.0),
            links=links,
            links_moved=links_moved,
            payload=payload,
            payload_moved=payload_moved,
        )


def _columns(
    chain: Chain, window: RowWindow, states: JointStates, regressor: Callable[..., FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Means of a regressor over the rows' windows, and (N, 3, ...) their change by delay and tilts."""
    weights = np.stack([window.weight, window.slope_weight])
    parts = []
    for samples in np.array_split(window.samples, max(len(window.middle) // Rows.at_once, 1)):
        columns = regressor(chain, *(values[samples.ravel()] for values in states))
        shape = columns.shape[1:]
        through = weights @ columns.reshape(*samples.shape, math.prod(shape))
        parts.append(through.reshape(len(samples), 2, *shape))
    both = np.concatenate(parts)
    middle = states.position_rad[window.middle]
    still = np.zeros_like(middle)
    tilted = [regressor(side, middle, still, still) for side in sideways(chain)]
    return both[:, 0], np.stack([-both[:, 1], *tilted], axis=1)


def weighted_sums(values: FloatArray, samples: NDArray[np.intp], weights: FloatArray) -> FloatArray:
    """(R, ...) sums over the (R, w) samples of each row of (K, ...) values, with (w,) weights."""
    found = np.zeros((len(samples), *values.shape[1:]))
    for places, weight in zip(samples.T, weights, strict=True):
        found += weight * values[places]
    return found
