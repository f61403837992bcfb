"""Check of the drives' torque offset (60B2) at standstill, before it is used in motion.

A fifth of the greatest torque that the payload will require is faded in and out repeatedly. The drives report (6077,
6078) the motor's total torque: the servo's own plus the offset. Friction holds a geared joint in place while the offset
changes by less than the friction, so the servo does not respond, and the total torque changes exactly by the drive's
implementation of the offset:

    measured = constant + drift + gain offset + delay d(offset)/dt        gain 1: sign and scale are right

fitted to a few fades at a time, since servos creep and slip at standstill; the median of the fits counts. If the servo
compensates fully (gain 0: no friction, or no 60B2), sign and scale cannot be determined and nothing is injected: the
total torque would stay constant with the wrong sign as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armload_controller.config.robot import Robot
from armload_controller.control_errors import OffsetRefused
from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.torque_monitor import measured_torque
from armload_controller.motion.checked_path import CheckedPath
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.robust_scale import deviation_by_median

CHECK_SHARE = 0.2
"""Share of the payload's greatest torque that is tried."""
TOLERANCE = 0.35
"""Greatest distance of the gain from 1."""
CERTAINTY = 0.12
"""Greatest standard error at which a gain counts as known; a third of the tolerance."""
SMALLEST_SHARE = 1e-3
"""A joint on which the payload's gravity torque is below this share of the greatest one is not tried."""
FADE_S = 0.25
"""One fade in and out."""
FADES = 4
"""Fades per fit of a gain: short enough for slow drift, and a slip spoils only one of many fits."""
LEAST_FITS = 8
MOST_FITS = 20
"""After this number of fits, a joint whose gain is still uncertain has no feed-forward."""
PATH_SAMPLES = 512
"""Positions along one period of a path among which the payload's greatest torque is looked for."""
_MEDIAN_EFFICIENCY = 1.2533
"""Standard error of a median relative to that of a mean, for normal errors."""


@dataclass(frozen=True, eq=False)
class OffsetVerdict:
    """Result of the check, per joint.

    Attributes:
        tried_nm: (n,) greatest offset.
        gain: (n,) response to it; 1 is right.
        sigma: (n,) standard error of the gain.
        fits: Number of fits.
    """

    joint_names: tuple[str, ...]
    tried_nm: FloatArray
    gain: FloatArray
    sigma: FloatArray
    fits: int

    @property
    def certain(self) -> NDArray[np.bool_]:
        """(n,) whether the gain is known accurately enough."""
        return self.sigma <= CERTAINTY

    @property
    def usable(self) -> NDArray[np.bool_]:
        """(n,) whether torque may be added: the gain is certain and right."""
        return self.certain & (np.abs(self.gain - 1.0) <= TOLERANCE)

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """(n,) whether the gain is certainly wrong; needs a smaller error, as a joint may slip now and then."""
        return (self.sigma <= CERTAINTY / 2.0) & (np.abs(self.gain - 1.0) > TOLERANCE)

    def require(self) -> NDArray[np.bool_]:
        """(n,) joints on which torque may be added; on the others the gain is undetermined, and nothing is added.

        Raises:
            OffsetRefused: a drive responds wrongly to its offset, or no joint is usable.
        """
        wrong = np.flatnonzero(self.wrong)
        if wrong.size or not self.usable.any():
            found = [self._response_in_words(int(i)) for i in wrong] or ["no joint's response exceeds the noise"]
            raise OffsetRefused(
                tuple(self.joint_names[i] for i in wrong),
                "torque offset at standstill: " + "; ".join(found) + ". No torque is added",
            )
        return self.usable

    def _response_in_words(self, joint: int) -> str:
        """Description of one joint's wrong response, and what to check."""
        gain = self.gain[joint]
        if abs(gain) <= TOLERANCE:
            what = "the servo compensates for it, or the drive ignores it: sign and scale cannot be determined"
        elif gain < 0:
            what = "the sign is wrong: check polarity (607E) and the direction of the axis"
        else:
            what = "the scale is wrong: check rated torque (6076) and gear ratio"
        return (
            f"{self.joint_names[joint]} was commanded {self.tried_nm[joint]:.1f} N m and responded with "
            f"{100 * gain:.0f} % of it, 100 +-{100 * TOLERANCE:.0f} expected; {what}"
        )


class OffsetCheck:
    """Plug-in that tries the offset of all joints simultaneously at standstill.

    Args:
        joint_names: Names, for messages.
        transmission: Converts motor current to joint torque.
        tried_nm: (n,) greatest offset of each joint.
        cycle_s: Duration of a cycle.

    Attributes:
        tried_nm: (n,) greatest offset of each joint.
    """

    name = "torque offset check"

    def __init__(
        self, joint_names: tuple[str, ...], transmission: Transmission, tried_nm: FloatArray, cycle_s: float
    ) -> None:
        self._joint_names, self._transmission, self.tried_nm = joint_names, transmission, tried_nm
        self._tried_joints = tried_nm > SMALLEST_SHARE * tried_nm.max()
        self._fade_cycles = max(8, round(FADE_S / cycle_s))
        self._fit_cycles = FADES * self._fade_cycles
        self._cycle = 0
        self._offset: list[FloatArray] = []
        self._torque: list[FloatArray] = []
        self._gains: list[FloatArray] = []

    @classmethod
    def along(cls, path: CheckedPath, robot: Robot, body: InertialParameters, least_nm: FloatArray) -> Self:
        """The check that precedes the torque of a payload along a path.

        Args:
            robot: The arm.
            body: The payload, or the heaviest possible one.
            least_nm: (n,) least torque to try on every joint.
        """
        tried_nm = np.maximum(tried_torque(robot.chain, body, positions_along(path)), least_nm)
        return cls(robot.joint_names, robot.drives.transmission, tried_nm, path.cycle_s)

    def on_cycle(self, step: CycleStep) -> FloatArray | None:
        """Fade in and out, and evaluate; the first fades, in which the gate opens, are not evaluated."""
        if step.sent is not None and self._cycle > self._fit_cycles:
            self._offset.append(step.sent.torque_offset_nm)
            self._torque.append(measured_torque(step.feedback, self._transmission))
            if len(self._offset) == self._fit_cycles:
                self._evaluate()
        if self.done():
            return None
        self._cycle += 1
        share = 0.5 - 0.5 * np.cos(2.0 * np.pi * self._cycle / self._fade_cycles)
        return np.asarray(share * self.tried_nm)

    def done(self) -> bool:
        """Whether the result is certain, or further fits are not worthwhile."""
        fits = len(self._gains)
        if fits < LEAST_FITS:
            return False
        verdict = self.verdict()
        return fits >= MOST_FITS or bool(verdict.usable[self._tried_joints].all() or verdict.wrong.any())

    def verdict(self) -> OffsetVerdict:
        """The result so far."""
        gains = np.array(self._gains)
        gain = np.median(gains, axis=0)
        spread = np.maximum(deviation_by_median(gains - gain), gains.std(axis=0))
        sigma = _MEDIAN_EFFICIENCY * spread / np.sqrt(len(gains))
        sigma = np.where(self._tried_joints, sigma, np.inf)
        return OffsetVerdict(self._joint_names, self.tried_nm, gain, sigma, len(gains))

    def _evaluate(self) -> None:
        """Gain of every joint from a few fades."""
        offset, torque = np.array(self._offset), np.array(self._torque)
        self._offset, self._torque = [], []
        t = np.linspace(-1.0, 1.0, self._fit_cycles)
        gain = np.zeros(offset.shape[1])
        for joint in np.flatnonzero(self._tried_joints):
            x = offset[:, joint]
            columns = np.column_stack([np.ones_like(t), t, t * t, np.gradient(x), x])
            gain[joint] = np.linalg.lstsq(columns, torque[:, joint], rcond=None)[0][-1]
        self._gains.append(gain)


def tried_torque(chain: Chain, payload: InertialParameters, position_rad: FloatArray) -> FloatArray:
    """(n,) torque to try in N m, at least 0: a fifth of the payload's greatest weight at (N, n) positions of a path."""
    still = np.zeros_like(position_rad)
    weight = payload_torque(chain, payload.theta, position_rad, still, still)
    return np.asarray(CHECK_SHARE * np.abs(weight).max(axis=0))


def positions_along(path: CheckedPath) -> FloatArray:
    """(N, n) positions along one period of a path."""
    trajectory = path.excitation.trajectory
    return trajectory.evaluate(np.linspace(0.0, trajectory.period_s, PATH_SAMPLES)).position_rad
