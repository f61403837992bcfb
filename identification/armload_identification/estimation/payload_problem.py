"""A payload as a problem: rows of one run, or of a loaded and an unloaded run, and the terms of the arm.

A pair needs no knowledge of the arm: links, rotors and friction are unknowns that both runs share, with wide priors.
Its two runs follow each other, so that friction changes less between them than over days. A calibration is knowledge of
the same terms, as a Gaussian; then one run suffices. What is known of the payload is another Gaussian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from armload_identification.estimation.arm_rows import (
    NO_ROWS,
    ArmLayout,
    ArmRows,
    RowWindow,
    close_rows,
    peak_rad_s,
    row_window,
)
from armload_identification.estimation.arm_terms import (
    GAIN,
    LEVELLED_RAD,
    PAYLOAD,
    TILT,
    WITHIN_HOURS,
    arm_terms,
    effort_level,
    friction_change,
    own_friction,
    recorder_delay,
    session_friction,
    session_load_friction,
    wide_payload,
)
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.estimation_constants import Priors
from armload_identification.estimation.prior_knowledge import Prior
from armload_identification.estimation.problem import (
    DIFFERENCE,
    DIFFERENCE_AND_MEAN,
    EMPTY,
    Group,
    Known,
    Noise,
    Problem,
    RunRows,
)
from armload_identification.estimation.term_kinds import Term
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import TURN_OVER

HELD: Final = 1e-6
"""Relative standard deviation of a gain that is not fitted: negligible, and it still shows what the gain matters."""


_GAINS: Final = ((GAIN, EMPTY),)
_TODAY: Final = "the spread between the calibration's runs, and a cold arm"


@dataclass(frozen=True, eq=False)
class PayloadProblem:
    """The problem of a payload and its arm.

    Attributes:
        problem: Its terms, rows and noise, without what is known of the payload.
        layout: The arm, with the tilt of its calibration.
        interval_s: Time between the samples of the runs.
    """

    problem: Problem
    layout: ArmLayout
    interval_s: float

    def knowing(self, prior: Prior | None) -> Problem:
        """The problem with knowledge of the payload."""
        if prior is None:
            return self.problem
        return replace(self.problem, known=(*self.problem.known, prior.known()))

    def with_gains(self, covariance: FloatArray) -> PayloadProblem:
        """The problem with an (n, n) covariance of the logarithms of the gains, errors common to them included."""
        precision = np.asarray(np.linalg.inv(covariance + HELD**2 * np.eye(len(covariance))))
        others = [known for known in self.problem.known if known.terms != _GAINS]
        gains = Known(_GAINS, precision, np.zeros(len(covariance)))
        return replace(self, problem=replace(self.problem, known=(*others, gains)))

    def require_rows(self, name: str) -> None:
        """Raise `EstimationError` if gaps leave no row of the runs, or of their part, with this name."""
        if not self.problem.groups[0].time_s.size:
            raise EstimationError(f"{name}: {NO_ROWS}.")

    def between(self, start_s: float, end_s: float) -> PayloadProblem:
        """The problem with the rows from one time up to, not including, another."""

        def part(rows: ArmRows) -> ArmRows:
            return rows.only((rows.time_s >= start_s) & (rows.time_s < end_s))

        groups = [group.changed(part) for group in self.problem.groups]
        return replace(self, problem=replace(self.problem, groups=groups))


def pair_problem(
    signal: LoadSignal, chain: Chain, coupling: FloatArray, arm: KnownArm | None, slow: LoadSignal | None = None
) -> PayloadProblem:
    """A payload from two runs of one motion; without a calibration the gains are held.

    Args:
        signal: The runs, their torque computed with the calibrated gains if there are any.
        chain: The arm, with the tilt of its calibration.
        coupling: (n, n) C of its motors.
        arm: The calibrated arm; None if unknown.
        slow: The same runs' slow rounds.
    """
    layout = _layout([signal.loaded, signal.unloaded], chain, coupling, arm)
    window = close_rows(_both_valid(signal)[0])
    rows = _pair_rows(signal, window, layout)
    groups = [Group((RunRows(rows[0], PAYLOAD), RunRows(rows[1])), DIFFERENCE_AND_MEAN)]
    differences = [(signal, window)]
    if slow is not None:
        window = row_window(_both_valid(slow)[0], spacing=2)
        if window.middle.size:  # a short one may have none
            groups.append(_slow_group(slow, window, layout))
            differences.append((slow, window))
    level = effort_level(rows)
    noise = _sampled_noise(level, differences, coupling)
    if arm is None:
        terms = arm_terms(rows, layout, {GAIN: np.full(chain.n, np.inf), TILT: np.full(2, LEVELLED_RAD)})
    else:
        terms = [*_known_arm(rows, chain, arm), session_friction(arm.friction_spread.ravel(), _TODAY)]
    own = friction_change(level, layout.peak_rad_s, WITHIN_HOURS, Priors.within_hours_freedom)
    problem = Problem([*terms, own], groups, noise, coupling, [] if arm is None else [arm.known])
    found = PayloadProblem(problem, layout, signal.loaded.interval_s)
    return found.with_gains(np.zeros((chain.n, chain.n))) if arm is None else found


def _sampled_noise(level_nm: FloatArray, parts: Sequence[tuple[LoadSignal, RowWindow]], coupling: FloatArray) -> Noise:
    """Unknown noise, but not less than the scatter of the samples: of few rows, a fit takes up much of it.

    Args:
        level_nm: (n,) RMS torque.
        parts: The periods, of whose rows difference and mean are fitted, and other parts, of which the difference is.
        coupling: (n, n) C of the motors.
    """
    rows = [window.noise(signal.noise_memory) for signal, window in parts]
    samples = [np.sqrt(signal.averaged_noise_nm**2 @ coupling**2) for signal, _ in parts]
    least = [np.sqrt(covariance[0]) * sample for covariance, sample in zip(rows, samples, strict=True)]
    correlation = [covariance / covariance[0] for covariance in rows]
    lags = max(one.size for one in correlation)
    faded = [np.pad(one, (0, lags - one.size)) for one in correlation]
    of_mean = 0.5 * least[0]
    return Noise.unknown(level_nm, np.array([least[0], of_mean, *least[1:]]), np.array([faded[0], *faded]))


def _slow_group(slow: LoadSignal, window: RowWindow, arm: ArmLayout) -> Group:
    """The slow rounds of two runs, with friction changes and noise of their own.

    Only their difference: the laws of friction do not describe so low speeds well.
    """
    rows = _pair_rows(slow, window, replace(arm, peak_rad_s=np.maximum(*map(peak_rad_s, _both_valid(slow)))))
    return Group((RunRows(rows[0], PAYLOAD), RunRows(rows[1])), DIFFERENCE, len(DIFFERENCE_AND_MEAN))


def _pair_rows(signal: LoadSignal, window: RowWindow, arm: ArmLayout) -> list[ArmRows]:
    """The same rows of the loaded and the unloaded run."""
    runs = zip(_both_valid(signal), (True, False), strict=True)
    return [arm.rows(run, loaded=loaded, window=window) for run, loaded in runs]


def _both_valid(signal: LoadSignal) -> list[Motion]:
    """The loaded and the unloaded run, valid where both are, at the loaded run's times.

    Two average periods differ in the last digits of theirs, by which the number of rows could differ.
    """
    return [replace(run, time_s=signal.loaded.time_s, valid=signal.valid) for run in (signal.loaded, signal.unloaded)]


def single_problem(run: Motion, chain: Chain, coupling: FloatArray, arm: KnownArm) -> PayloadProblem:
    """A payload from one run of any motion on a calibrated arm.

    Args:
        run: The run, its torque computed with the calibrated gains.
        chain: The arm, with the tilt of its calibration.
        coupling: (n, n) C of its motors.
        arm: The calibrated arm.
    """
    layout = _layout([run], chain, coupling, arm)
    rows = layout.rows(run, loaded=True)
    noise = Noise(arm.noise_nm, arm.noise_nm, effort_level([rows]) + arm.noise_nm)
    group = Group((RunRows(rows, PAYLOAD),))
    terms = [*_known_arm([rows], chain, arm), own_friction(arm.friction_spread.ravel(), _TODAY)]
    problem = Problem(terms, [group], noise, coupling, [arm.known])
    return PayloadProblem(problem, layout, run.interval_s)


def _layout(runs: Sequence[Motion], chain: Chain, coupling: FloatArray, arm: KnownArm | None) -> ArmLayout:
    """The arm: with the base parameters and greatest speeds of its calibration, or of the runs."""
    if arm is not None:
        return ArmLayout(chain, coupling, arm.body.base.ravel(), arm.body.reversal_speed_rad_s / TURN_OVER)
    return ArmLayout.of(runs, chain, coupling)


def _known_arm(rows: Sequence[ArmRows], chain: Chain, arm: KnownArm) -> list[Term]:
    """Terms of a calibrated arm and of its payload, without friction of this session and of single runs."""
    load_friction = session_load_friction(arm.load_friction_spread, _TODAY)
    return [*arm.terms, recorder_delay(), load_friction, wide_payload(rows, chain)]
