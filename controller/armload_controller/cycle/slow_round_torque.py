"""What the torque of a slow round shows: its sign, zero and scale on every joint, and what the arm carries.

In a slow round only gravity and friction matter. Every joint's torque, averaged over `AVERAGED_S`, is fitted with

    tau_j = G_j(q) phi_j + f_j tanh(dq_j / v) + o_j         joint by joint
    tau   = G(q) phi + f tanh(dq / v) + o                   all joints with the same masses phi

where the columns G describe arbitrary masses on every link, and v is a share of the joint's greatest speed. From the
first come friction f_j, which a wrong sign makes negative, and zero o_j. In the second one more column at a time, the
joint's own torque G_j phi_j, gives its scale relative to the others. A joint whose torque gravity does not change, such
as one with a vertical axis, shows its sign and zero only.

With the arm's own torque known (`[body]` or a calibration), or from a slow round of the same arm before,

    tau - tau_arm = G_flange(q) payload + a tau_arm + f tanh(dq / v) + o,        a ~ N(0, deviation^2)

the mass on the flange is determined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from armload_controller.cycle.empty_slow_round import CORRELATED_ROWS, SPEED_SHARE, EmptySlowRound, Gravity
from armload_controller.cycle.feedback_truth import TorqueMissing, TorqueReversed
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.phase import Segment
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import payload_regressor
from armload_identification.signals.joint_torque import Transmission

AVERAGED_S = 0.1
"""Time over which positions and torques are averaged. Twice as much: short motions are blurred."""
LEAST_TRAVEL_RAD = 0.2
"""A joint with less total travel is not checked."""
SURE = 4.0
"""A finding is reported if it is so many standard errors away from what is allowed."""
WRONG_FACTOR = 2.0
"""A scale further from 1 is reported. Without faults: up to 1.6 on the simulated arms (friction grows with load)."""
EXPLAINS_SHARE = 0.9
"""Joints whose scale explains this share of what the best one's explains are named as well."""
ZERO_SHARE = 0.05
"""Share of a joint's torque limit by which its zero may be wrong. Without faults: 0.02 on the simulated arms."""
ZERO_SURE = 8.0
"""A zero is reported if it is so many standard errors beyond that. Without faults: up to 6.5 on the simulated arms.
Where the motion hardly changes the gravity of a joint, friction that grows with load looks like a zero."""
ROWS_PER_MOMENT = 1.5
"""Least number of averaged rows per first moment of a link. A third more: exchanged, prbt's joints 2 and 3 stop the arm
before they are named."""
_FIRST_MOMENTS = 4
"""Mass and first moments: the parameters that gravity torque depends on."""
_UNDETERMINED_SHARE = 1e-9
"""Directions with a smaller share of the greatest singular value are not determined."""


class SlowRoundRows:
    """Positions and torques of a slow round, averaged; a plug-in of the cycle.

    Args:
        cycle_s: Duration of a cycle.
    """

    name = "slow round"

    def __init__(self, cycle_s: float) -> None:
        self.cycle_s = cycle_s
        self._every = max(1, round(AVERAGED_S / cycle_s))
        self._positions: list[FloatArray] = []
        self._efforts: list[FloatArray] = []
        self._is_torque = False

    def on_cycle(self, step: CycleStep) -> None:
        """Keep a row of a slow round."""
        reference = step.sent_reference
        if reference is not None and reference.segment is Segment.SLOW:
            feedback = step.feedback
            self.add(feedback.position_rad, feedback.torque_nm, feedback.current_a)

    def add(self, position_rad: FloatArray, torque_nm: FloatArray | None, current_a: FloatArray | None) -> None:
        """Keep (n,) positions, and joint torques or motor currents if reported."""
        effort = current_a if torque_nm is None else torque_nm
        if effort is not None:
            self._is_torque = torque_nm is not None
            self._positions.append(position_rad)
            self._efforts.append(effort)

    def fitted(self, joint_names: tuple[str, ...], chain: Chain, transmission: Transmission) -> SlowRoundTorque | None:
        """The fit of these rows; None if there are too few, or no joint has moved.

        Raises:
            FeedbackError: a joint's torque is missing or reversed.
        """
        count = len(self._positions) // self._every
        if count < ROWS_PER_MOMENT * _FIRST_MOMENTS * chain.n:
            return None
        position, effort = (
            np.array(rows[: count * self._every]).reshape(count, self._every, chain.n).mean(axis=1)
            for rows in (self._positions, self._efforts)
        )
        torque = transmission.of_effort(effort, from_torque=self._is_torque)
        found = SlowRoundTorque(joint_names, chain, position, torque)
        return found if len(found.moved) else None


@dataclass(frozen=True)
class Mass:
    """A mass and its standard error, in kg."""

    kg: float
    error_kg: float

    @property
    def greatest_kg(self) -> float:
        """The greatest mass that it may be."""
        return max(0.0, self.kg) + SURE * self.error_kg


class SlowRoundTorque:
    """A slow round's torque, fitted.

    Args:
        joint_names: Names, for messages.
        position: (N, n) positions at equal intervals `AVERAGED_S`.
        torque: (N, n) joint torques.

    Raises:
        TorqueMissing: a joint's torque never changed.
        TorqueReversed: a joint's torque has the wrong sign.
    """

    def __init__(self, joint_names: tuple[str, ...], chain: Chain, position: FloatArray, torque: FloatArray) -> None:
        self._names, self._chain, self.position_rad, self._torque = joint_names, chain, position, torque
        n, travel = chain.n, np.abs(np.diff(position, axis=0)).sum(axis=0)
        self.moved = np.flatnonzero(travel > LEAST_TRAVEL_RAD)
        self._weight = _weight_columns(chain, position)
        velocity = np.gradient(position, axis=0)
        direction = np.tanh(velocity / (SPEED_SHARE * np.abs(velocity).max(axis=0) + np.finfo(float).tiny))
        self._own, self._friction, self._noise = np.zeros_like(torque), np.zeros((*torque.shape, 2 * n)), np.ones(n)
        self.zero = [(0.0, np.inf)] * n
        for joint in self.moved:
            if np.ptp(torque[:, joint]) <= 1e-9 * np.abs(torque[:, joint]).max():
                raise TorqueMissing(
                    joint_names[joint],
                    f"current or torque stayed at {torque[0, joint]:.1f} N m during the whole slow round",
                )
            columns = np.column_stack([direction[:, joint], np.ones(len(position)), self._weight[:, joint]])
            fit = _fitted(columns, torque[:, joint])
            errors = np.sqrt(np.diag(fit.covariance) * fit.variance * CORRELATED_ROWS)
            friction = fit.x[0]
            if friction < -SURE * errors[0]:
                raise TorqueReversed(
                    joint_names[joint],
                    f"torque falls by {-2.0 * friction:.1f} N m when the motion reverses from negative to positive, "
                    "but friction makes it rise: the sign of current or torque is wrong",
                )
            self.zero[joint] = float(fit.x[1]), float(errors[1])
            self._own[:, joint] = self._weight[:, joint] @ fit.x[2:]
            self._noise[joint] = max(np.sqrt(fit.variance), np.finfo(float).tiny)
            self._friction[:, joint, joint], self._friction[:, joint, n + joint] = direction[:, joint], 1.0

    def doubts(self, torque_max_nm: FloatArray) -> list[str]:
        """What is probably wrong with the zero or scale of a torque, as texts for the operator.

        Args:
            torque_max_nm: (n,) limits of the joints' torques.
        """
        texts = [
            f"{self._names[joint]}: its torque is {self.zero[joint][0]:.1f} N m off zero. Check the zero of its "
            "current, or what pulls at the joint"
            for joint in self.moved
            if abs(self.zero[joint][0]) - ZERO_SURE * self.zero[joint][1] > ZERO_SHARE * torque_max_nm[joint]
        ]
        columns = self._whitened(self._weight, self._friction)
        torque = self._whitened(self._torque[:, :, None])[:, 0]
        before = _fitted(columns, torque).variance
        found = []
        for joint in self.moved:
            own = np.zeros((*self._own.shape, 1))
            own[:, joint, 0] = -self._own[:, joint]
            fit = _fitted(np.column_stack([columns, self._whitened(own)]), torque)
            wanted, error = 1.0 + fit.x[-1], SURE * fit.error(-1)
            if wanted - error > WRONG_FACTOR or wanted + error < 1.0 / WRONG_FACTOR:
                found.append((fit.variance, self._names[joint], wanted))
        if found:
            least = min(found)[0]
            named = [
                f"{name}'s " + ("has the wrong sign" if wanted <= 0.0 else f"is {1.0 / wanted:.2g} times the right one")
                for variance, name, wanted in sorted(found)
                if before - variance >= EXPLAINS_SHARE * (before - least)
            ]
            texts.append(
                f"the joints' torques contradict each other: {', or '.join(named)}. Check rated current, torque "
                "constant and gear ratio"
            )
        return texts

    def of_empty_arm(self, gravity: Gravity, deviation: FloatArray) -> EmptySlowRound:
        """This slow round as that of an empty arm.

        Args:
            gravity: (N, n) torque of the arm at rest, from positions and gravity.
            deviation: (n,) relative standard deviation of each joint's.
        """
        return EmptySlowRound(
            self._names,
            self.position_rad,
            self._torque,
            self._noise,
            gravity,
            self._chain.gravity_m_s2,
            deviation,
            self._flange_columns(),
        )

    def carried(self, arm_nm: FloatArray, deviation: FloatArray) -> Mass:
        """The mass on the flange of an arm whose own torque is known.

        Args:
            arm_nm: (N, n) torque of the arm alone.
            deviation: (n,) relative standard deviation of each joint's.
        """
        own = np.zeros((*arm_nm.shape, len(deviation)))
        own[:, range(len(deviation)), range(len(deviation))] = arm_nm * deviation
        columns = self._whitened(self._flange_columns(), self._friction, own)
        prior = np.eye(columns.shape[1])[-len(deviation) :]
        values = self._whitened((self._torque - arm_nm)[:, :, None])[:, 0]
        return _fitted(np.vstack([columns, prior]), np.append(values, np.zeros(len(deviation)))).mass

    def added_since(self, before: SlowRoundTorque) -> Mass:
        """The mass that the flange carries more than in an earlier slow round of the same arm."""
        columns, values = zip(self.rows_of_all_masses(1.0), before.rows_of_all_masses(0.0), strict=True)
        return _fitted(np.vstack(columns), np.concatenate(values)).mass

    def rows_of_all_masses(self, flange: float) -> tuple[FloatArray, FloatArray]:
        """(R, K) columns of the flange times a factor, of all links and of friction; and (R,) torques."""
        columns = self._whitened(flange * self._flange_columns(), self._weight, self._friction)
        return columns, self._whitened(self._torque[:, :, None])[:, 0]

    def _flange_columns(self) -> FloatArray:
        """(N, n, 4) gravity torque of a unit mass and unit first moments on the flange."""
        still = np.zeros_like(self.position_rad)
        return payload_regressor(self._chain, self.position_rad, still, still)[:, :, :_FIRST_MOMENTS]

    def _whitened(self, *columns: FloatArray) -> FloatArray:
        """(N m, K) columns of the m joints that moved, weighted so that errors of unknowns follow as if independent."""
        scale = self._noise[self.moved, None] * np.sqrt(CORRELATED_ROWS)
        rows: FloatArray = np.concatenate(columns, axis=2)[:, self.moved] / scale
        return rows.reshape(-1, rows.shape[2])


@dataclass(frozen=True, eq=False)
class _Fit:
    """Least squares.

    Attributes:
        x: (K,) the unknowns; of those that are not determined, the smallest.
        covariance: (K, K) at unit variance of the rows.
        variance: Of the residual.
    """

    x: FloatArray
    covariance: FloatArray
    variance: float

    def error(self, unknown: int) -> float:
        """Standard error from whitened rows, whose variance is expected to be 1 / `CORRELATED_ROWS`."""
        return math.sqrt(self.covariance[unknown, unknown] * max(1.0, self.variance * CORRELATED_ROWS))

    @property
    def mass(self) -> Mass:
        """The first unknown."""
        return Mass(float(self.x[0]), self.error(0))


def _weight_columns(chain: Chain, position: FloatArray) -> FloatArray:
    """(N, n, K) gravity torque of unit masses and first moments of every link."""
    still = np.zeros_like(position)
    columns = []
    for link in range(1, chain.n + 1):
        head = chain.head(link)
        part = np.zeros((*position.shape, _FIRST_MOMENTS))
        moving = position[:, :link], still[:, :link], still[:, :link]
        part[:, :link] = payload_regressor(head, *moving)[:, :, :_FIRST_MOMENTS]
        columns.append(part)
    return np.concatenate(columns, axis=2)


def _fitted(columns: FloatArray, values: FloatArray) -> _Fit:
    """Least squares by singular values."""
    basis, sizes, turned = np.linalg.svd(columns, full_matrices=False)
    kept = sizes > _UNDETERMINED_SHARE * sizes[0]
    inverse = turned[kept].T / sizes[kept]
    x = inverse @ (basis[:, kept].T @ values)
    residual = values - columns @ x
    return _Fit(x, inverse @ inverse.T, float(residual @ residual) / max(1, len(values) - int(kept.sum())))
