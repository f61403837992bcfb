"""A run of the empty arm as equations: means over windows of a third of a second.

Measured torque and model go through the same window (`row_window`), and a joint's row counts only if the joint keeps
its direction in it. Friction that grows with the load is averaged too: near a change of sign, |mean torque| is smaller
than the mean of |torque|, which made mu a tenth too small on a drafted arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.model.body_model import smooth_sign
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import body_regressor
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import REVERSAL, TURN_OVER, moving_weights
from armload_identification.signals.row_window import RowWindow, weighted_sums

_ROW_S: Final = 0.05
_MODEL_S: Final = 0.01
"""Interval of the model's samples within a row's window."""
_FEW: Final = 0.1
"""Share of its rows that a joint must keep; a joint that reverses more often is weighted by its speed alone."""


@dataclass(frozen=True, eq=False)
class BodyRows:
    """N rows of a run of n joints with b base parameters: means over the rows' windows, and their time derivatives.

    Attributes:
        torque_nm: (N, n).
        velocity_rad_s: (N, n).
        acceleration_rad_s2: (N, n).
        jerk_rad_s3: (N, n).
        direction: (N, n) direction of motion, -1 to 1.
        weight: (N, n) 0 where the joint reverses within the window or rests, or a sample is invalid.
        links: (N, n, b) joint torque per base parameter of the links.
        links_rate: (N, n, b) its time derivative.
    """

    torque_nm: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    jerk_rad_s3: FloatArray
    direction: FloatArray
    weight: FloatArray
    links: FloatArray
    links_rate: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[BodyRows]) -> BodyRows:
        """The rows of several runs."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


@dataclass(frozen=True, eq=False)
class BodySamples:
    """The links of a run's model, sample by sample, and the windows of its rows.

    Attributes:
        window: Of the run's samples.
        coarse: The same rows of the model's M samples, which are fewer.
        there: (M,) indices of the model's samples.
        turn_over: (n,) speed that smooths the direction of motion.
        direction: (M, n) direction of motion, -1 to 1.
        links: (M, n, b) joint torque per base parameter of the links.
    """

    window: RowWindow
    coarse: RowWindow
    there: NDArray[np.intp]
    turn_over: FloatArray
    direction: FloatArray
    links: FloatArray

    @classmethod
    def of(cls, run: Motion, chain: Chain, base: NDArray[np.bool_], turn_over: FloatArray) -> BodySamples:
        """The samples of a run.

        Args:
            run: The run.
            chain: The arm.
            base: (10 n,) True for base parameters.
            turn_over: (n,) speed that smooths the direction of motion.
        """
        thin = max(int(_MODEL_S / run.interval_s), 1)
        step = thin * max(round(_ROW_S / (thin * run.interval_s)), 1)
        window = RowWindow.of(len(run.time_s), run.interval_s, step, periodic=run.periodic)
        coarse = window.every(thin)
        there = np.unique(coarse.samples)
        states = [values[there] for values in run.states]
        links = body_regressor(chain, *states)[:, :, base]
        return cls(window, coarse, there, turn_over, smooth_sign(states[1], turn_over), links)

    def losses(self, links: FloatArray) -> FloatArray:
        """(N, n) means of s |tau_links|.

        Args:
            links: (b,) base parameters.
        """
        return weighted_sums(self.direction * np.abs(self.links @ links), self._place, self.coarse.weight)

    def rows(self, run: Motion, moving: NDArray[np.bool_]) -> BodyRows:
        """The rows of the run.

        Args:
            run: The run.
            moving: (n,) False for joints at rest, none of whose rows counts.
        """
        window = self.window
        _, dq, ddq = run.states
        direction, velocity = smooth_sign(dq, self.turn_over), window.mean(dq)
        onward = window.onward(direction)
        onward = np.where(onward.mean(axis=0) > _FEW, onward, 1.0)
        gate = moving_weights(velocity, REVERSAL / TURN_OVER * self.turn_over)
        weight = np.where(moving, onward * gate, 0.0)
        return BodyRows(
            torque_nm=window.mean(run.torque_nm),
            velocity_rad_s=velocity,
            acceleration_rad_s2=window.mean(ddq),
            jerk_rad_s3=window.slope(ddq),
            direction=window.mean(direction),
            weight=np.where(window.usable(run.valid)[:, None], weight, 0.0),
            links=weighted_sums(self.links, self._place, self.coarse.weight),
            links_rate=weighted_sums(self.links, self._place, self.coarse.slope_weight),
        )

    @cached_property
    def _place(self) -> NDArray[np.intp]:
        """(N, w) indices among the model's samples of each row's."""
        return np.asarray(np.searchsorted(self.there, self.coarse.samples))
