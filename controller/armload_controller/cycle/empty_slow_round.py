"""A mistake in the robot's file, recognised from the slow round of an empty arm whose own torque is known.

The arm's weight, by its `[body]` or its calibration, must explain the torques. If it does not, each possible mistake is
assumed in turn, and the torque fitted again:

    C tau - g(A q + d; gravity) = a g + f s + v dq + o + mu |g| s
    a ~ N(0, deviation^2), mu ~ N(0, LOAD_FRICTION^2)

with s the direction of motion, A and C the identity except for the mistake: a torque of another scale, an axis that
turns the other way, another gear ratio, two exchanged joints, another zero (d), a base that is not level (gravity), and
something on the flange. The mistake that leaves the smallest misfit is named, with the others that explain nearly as
much. A joint whose weight does not change along the path, such as one with a vertical axis, shows none of this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from math import acos, degrees, log

import numpy as np

from armload_identification.float_array import FloatArray

SPEED_SHARE = 0.05
"""Share of a joint's greatest speed at which friction reaches most of its value."""
CORRELATED_ROWS = 5
"""Errors of the model, such as friction that varies with position, are assumed to be fully correlated for so long.
Twice as much: standard errors grow by 1.4."""
LOAD_FRICTION = 0.05
"""Standard deviation of friction per torque of the links, around 0. Twice as much: a scale of 0.7 is missed."""
RATIOS = np.concatenate([np.geomspace(0.5, 0.92, 8), np.geomspace(1.08, 2.0, 8)])
"""Gear ratios that are tried, as factors on the file's."""
ZEROS_RAD = np.concatenate([np.linspace(-0.6, -0.05, 12), np.linspace(0.05, 0.6, 12)])
"""Displacements of a zero that are tried; smaller ones are lost in a weight that is known to 10 %."""
LEAST_GAIN = 12.0
"""Least decrease of the misfit, in squared standard errors, for which a mistake is named. Half as much: links that are
wrong by a tenth look like another gear ratio."""
LEAST_GAIN_OF_SCALE = 6.0
"""The same for a torque's scale, which only contradicts what is known of the arm. Twice as much: 0.7 is missed."""
LEAST_SCALE = 0.2
"""A torque's scale is named if it is at least so far from 1; twice as much: 0.7 is missed."""
LEAST_TILT_DEG = 2.0
"""A tilt of the base is named if it is at least so great; half as much: elastic gears look like one."""
NEARLY = 0.8
"""Mistakes that decrease the misfit by this share of the best one's are named as well."""
FREE = 1e3
"""Prior deviation of an unknown that may have any value, in units of its column."""

Gravity = Callable[[FloatArray, FloatArray], FloatArray]
"""(N, n) torque of the empty arm at rest, from (N, n) positions and (3,) gravity."""


@dataclass(frozen=True)
class Explanation:
    """What may be wrong in the robot's file.

    Attributes:
        text: For the operator: what is wrong, and what to change in the file.
        gain: Decrease of the misfit by assuming it, in squared standard errors.
        least_gain: Gain from which it is worth a word.
    """

    text: str
    gain: float
    least_gain: float


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fit under one assumption: its misfit in squared standard errors, and the (K,) unknowns named as free."""

    misfit: float
    free: FloatArray


@dataclass(frozen=True, eq=False)
class EmptySlowRound:
    """The slow round of an empty arm whose own torque is known.

    Attributes:
        position_rad: (N, n) positions.
        torque_nm: (N, n) torques.
        noise_nm: (n,) standard deviation of what remains of each torque in a fit with arbitrary links.
        gravity: Torque of the arm.
        gravity_m_s2: (3,) gravity by the file.
        deviation: (n,) relative standard deviation of the arm's torque.
        flange: (N, n, 4) gravity torque of a unit mass and of unit first moments on the flange.
    """

    joint_names: tuple[str, ...]
    position_rad: FloatArray
    torque_nm: FloatArray
    noise_nm: FloatArray
    gravity: Gravity
    gravity_m_s2: FloatArray
    deviation: FloatArray
    flange: FloatArray

    def explanations(self) -> list[Explanation]:
        """What explains the torques better than the file as it is, best first; empty if nothing does.

        Something on the flange is among them, with an empty text: its mass is determined by `SlowRound.carried`.
        """
        plain = self._fit(self.position_rad, self.torque_nm).misfit
        others = (Explanation(text, plain - misfit, LEAST_GAIN) for text, misfit in self._assumptions())
        scales = (Explanation(text, plain - misfit, LEAST_GAIN_OF_SCALE) for text, misfit in self._scales())
        every = (each for each in (*others, *scales) if each.gain > each.least_gain)
        found = sorted(every, key=lambda each: -each.gain)
        return [each for each in found if each.gain >= NEARLY * found[0].gain]

    def _assumptions(self) -> Iterator[tuple[str, float]]:
        """Text and misfit of every assumption but a torque's scale."""
        yield "", self._fit(self.position_rad, self.torque_nm, self.flange).misfit
        yield from self._tilts()
        for joint, name in enumerate(self.joint_names):
            yield from self._of_joint(joint, name)
        for one, other in combinations(range(len(self.joint_names)), 2):
            order = list(range(len(self.joint_names)))
            order[one], order[other] = other, one
            names = f"{self.joint_names[one]} and {self.joint_names[other]}"
            fit = self._fit(self.position_rad[:, order], self.torque_nm[:, order], noise=self.noise_nm[order])
            yield f"{names} seem to be exchanged: exchange their node_id", fit.misfit

    def _tilts(self) -> Iterator[tuple[str, float]]:
        """A base that is not mounted as the file says."""
        size = float(np.linalg.norm(self.gravity_m_s2))
        columns = np.stack([self.gravity(self.position_rad, size * axis) for axis in np.eye(3)], axis=2)
        fit = self._fit(self.position_rad, self.torque_nm, columns)
        found = self.gravity_m_s2 / size + fit.free
        found /= max(float(np.linalg.norm(found)), np.finfo(float).tiny)
        angle = degrees(acos(min(1.0, float(found @ self.gravity_m_s2) / size)))
        if angle >= LEAST_TILT_DEG:
            vector = ", ".join(f"{value:.2f}" for value in size * found)
            text = f"the base seems to be mounted {angle:.0f} degrees otherwise: set [robot] gravity_m_s2 = [{vector}]"
            yield text, fit.misfit

    def _scales(self) -> Iterator[tuple[str, float]]:
        """A torque of another scale, joint by joint."""
        weight = self.gravity(self.position_rad, self.gravity_m_s2)
        for joint, name in enumerate(self.joint_names):
            own = np.zeros((*weight.shape, 1))
            own[:, joint, 0] = weight[:, joint]
            fit = self._fit(self.position_rad, self.torque_nm, own)
            factor = 1.0 + float(fit.free[0])
            if factor > 0.0 and abs(log(factor)) >= LEAST_SCALE:
                yield (
                    f"{name}: its torque seems to be {factor:.2g} times the right one: divide its torque constant or "
                    f"rated_torque_nm by {factor:.2g}",
                    fit.misfit,
                )

    def _of_joint(self, joint: int, name: str) -> Iterator[tuple[str, float]]:
        """An axis that turns the other way, another gear ratio (which changes position and torque), another zero."""
        is_joint = np.arange(len(self.joint_names)) == joint

        def scaled(factor: float) -> float:
            scale = np.where(is_joint, factor, 1.0)
            noise_nm = self.noise_nm / np.abs(scale)
            return self._fit(scale * self.position_rad, self.torque_nm / scale, noise=noise_nm).misfit

        yield f"{name} seems to turn the other way: reverse its axis in the file or the polarity (607E)", scaled(-1.0)
        misfit, ratio = min((scaled(ratio), ratio) for ratio in RATIOS)
        yield f"{name} seems to turn {ratio:.2f} times as far as reported: divide its gear_ratio by {ratio:.2f}", misfit
        moved = ((self._fit(self.position_rad + zero * is_joint, self.torque_nm).misfit, zero) for zero in ZEROS_RAD)
        misfit, zero = min(moved)
        yield (
            f"{name} seems to stand at {degrees(zero):+.0f} degrees where it reports zero: reference it again, "
            "or turn its placement in the file",
            misfit,
        )

    def _fit(
        self,
        position: FloatArray,
        torque: FloatArray,
        free: FloatArray | None = None,
        *,
        noise: FloatArray | None = None,
    ) -> _Fit:
        """Least squares with priors; `free` has (N, n, K) further columns without one."""
        n = len(self.joint_names)
        own = self.gravity(position, self.gravity_m_s2)
        speed = np.gradient(position, axis=0)
        greatest = np.abs(speed).max(axis=0) + np.finfo(float).tiny
        direction = np.tanh(speed / (SPEED_SHARE * greatest))
        errors = (self.noise_nm if noise is None else noise) * np.sqrt(CORRELATED_ROWS)
        # every joint has unknowns of its own; only free columns connect them
        parts = np.stack([own, direction, speed / greatest, np.ones_like(own), np.abs(own) * direction], axis=2)
        sizes = np.stack([self.deviation, *np.full((3, n), FREE), np.full(n, LOAD_FRICTION)], axis=1)
        parts *= sizes / errors[:, None]
        values = (torque - own) / errors
        blocks, count = np.einsum("tjp,tjq->jpq", parts, parts), parts.shape[2]
        normal = np.eye(n * count)
        for joint in range(n):
            place = slice(joint * count, (joint + 1) * count)
            normal[place, place] += blocks[joint]
        moment = np.einsum("tjp,tj->jp", parts, values).ravel()
        if free is not None:
            more = free * (FREE / errors[:, None])
            cross = np.einsum("tjp,tjk->jpk", parts, more).reshape(n * count, -1)
            corner = np.einsum("tjk,tjl->kl", more, more) + np.eye(more.shape[2])
            normal = np.block([[normal, cross], [cross.T, corner]])
            moment = np.append(moment, np.einsum("tjk,tj->k", more, values))
        x = np.linalg.solve(normal, moment)
        return _Fit(float(np.sum(values**2) - moment @ x), FREE * x[n * count :])
