"""What goes wrong on real arms, done to recordings: other torque, payloads that change, clocks, channels, gains.

A modification acts on the loaded run, or on both runs of a pair. Torque is added in the recording's own unit; the
motion stays as it is, as a servo would hold it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.spline import fit_motion


class Acts(StrEnum):
    """Which runs a modification acts on."""

    LOADED = "loaded run"
    BOTH = "both runs"


@dataclass(frozen=True, eq=False)
class ModifiedRun:
    """A recording with what is needed to modify it.

    Attributes:
        run: The recording.
        chain: The arm.
        transmission: Its nominal gains, and coupling.
        payload: What it carries.
    """

    run: Recording
    chain: Chain
    transmission: Transmission
    payload: InertialParameters

    @cached_property
    def states(self) -> JointStates:
        """(N, n) each: motion at the rows."""
        path = fit_motion(self.run.time_s, self.run.position_rad)
        elapsed_s = self.run.time_s - self.run.time_s[0]
        return JointStates(*(np.ascontiguousarray(path.spline(elapsed_s, order)) for order in range(3)))

    @property
    def share(self) -> FloatArray:
        """(N, 1) share of the run's time, 0 to 1."""
        elapsed_s = self.run.time_s - self.run.time_s[0]
        return np.asarray((elapsed_s / elapsed_s[-1])[:, None])

    @property
    def elapsed_s(self) -> FloatArray:
        """(N, 1) time since the first row."""
        return np.asarray((self.run.time_s - self.run.time_s[0])[:, None])

    @property
    def size_nm(self) -> FloatArray:
        """(n,) RMS joint torque of the payload."""
        return np.asarray(np.sqrt(np.mean(self.of_body(self.payload) ** 2, axis=0)))

    def of_body(self, body: InertialParameters) -> FloatArray:
        """(N, n) joint torque of a body at the flange."""
        return payload_torque(self.chain, body.theta, *self.states)

    def of_weight(self, body: InertialParameters, gravity_m_s2: FloatArray) -> FloatArray:
        """(N, n) joint torque that holds a body in a field of gravity, without its inertial torque."""
        chain = self.chain.under(gravity_m_s2)
        position = self.states.position_rad
        return payload_torque(chain, body.theta, position, np.zeros_like(position), np.zeros_like(position))

    def plus(self, torque_nm: FloatArray) -> Recording:
        """The recording with (N, n) joint torque added."""
        if self.run.torque_nm is not None:
            return replace(self.run, torque_nm=self.run.torque_nm + torque_nm)
        current = torque_nm @ self.transmission.coupling / self.transmission.gain_nm_a
        return self.with_effort(lambda effort: effort + current)

    def with_effort(self, change: Callable[[FloatArray], FloatArray]) -> Recording:
        """The recording with its (N, n) torque or current changed, as a copy."""
        if self.run.torque_nm is not None:
            return replace(self.run, torque_nm=change(np.array(self.run.torque_nm)))
        return replace(self.run, current_a=change(np.array(self.run.current_a)))

    def with_position(self, change: Callable[[FloatArray], FloatArray]) -> Recording:
        """The recording with its (N, n) positions changed, as a copy; the velocity is left out."""
        return replace(self.run, position_rad=change(np.array(self.run.position_rad)), velocity_rad_s=None)

    def pushed(self, force_n: FloatArray) -> Recording:
        """The recording with (N, 3) force on the flange in the base frame: the weight of a mass of 1 kg there."""
        unit = InertialParameters(np.array([1.0, *np.zeros(9)]))
        parts = (force_n[:, axis, None] * self.of_weight(unit, np.eye(3)[axis]) for axis in range(3))
        return self.plus(np.sum(list(parts), axis=0))


Change = Callable[[ModifiedRun], Recording]


@dataclass(frozen=True, eq=False)
class Modification:
    """One modification.

    Attributes:
        name: What it is, in a few words.
        acts: On which runs.
        change: What it does to a run.
        of_payload: Whether it changes the payload, so that no single one is right.
        hangs_kg: Mass of a weight on the flange that nothing distinguishes from it at rest, which is then right.
    """

    name: str
    acts: Acts
    change: Change
    of_payload: bool = False
    hangs_kg: float = 0.0


def _on(joint: int, change: Callable[[FloatArray], FloatArray]) -> Callable[[FloatArray], FloatArray]:
    """Changes one column."""

    def changed(values: FloatArray) -> FloatArray:
        values[:, joint] = change(values[:, joint])
        return values

    return changed


def _columns(order: dict[int, int]) -> Callable[[FloatArray], FloatArray]:
    """Exchanges columns."""
    return lambda values: values[:, [order.get(joint, joint) for joint in range(values.shape[1])]]


def _times(factor: float, joint: int | None = None) -> Change:
    """Scales the effort of a joint, or of all."""
    if joint is None:
        return lambda arm: arm.with_effort(lambda effort: factor * effort)
    return lambda arm: arm.with_effort(_on(joint, lambda column: factor * column))


def _drag(joint: int, share: float) -> Change:
    """A hose that pulls a joint to the middle of its travel, with a share of the payload's torque on joint 2."""

    def dragged(arm: ModifiedRun) -> Recording:
        away = arm.run.position_rad[:, joint] - arm.run.position_rad[:, joint].mean()
        torque = np.zeros_like(arm.run.position_rad)
        torque[:, joint] = share * arm.size_nm[1] / max(float(np.abs(away).max()), 1e-9) * away
        return arm.plus(torque)

    return dragged


def _changed_payload(
    body: Callable[[InertialParameters], InertialParameters], share: Callable[[FloatArray], FloatArray]
) -> Change:
    """Another payload to a share that depends on the run's time."""
    return lambda arm: arm.plus(share(arm.share) * (arm.of_body(body(arm.payload)) - arm.of_body(arm.payload)))


def _lighter(kg: float) -> Callable[[InertialParameters], InertialParameters]:
    """A payload that lost mass at its centre of mass."""

    def lighter(body: InertialParameters) -> InertialParameters:
        return InertialParameters.from_center_of_mass(body.mass_kg - kg, body.center_of_mass_m, body.inertia_about_com)

    return lighter


def _scaled(factor: float) -> Callable[[InertialParameters], InertialParameters]:
    return lambda body: InertialParameters(factor * body.theta)


def _slipped(by_m: tuple[float, float, float]) -> Callable[[InertialParameters], InertialParameters]:
    """A payload at another place."""

    def slipped(body: InertialParameters) -> InertialParameters:
        return InertialParameters.from_center_of_mass(
            body.mass_kg, body.center_of_mass_m + np.array(by_m), body.inertia_about_com
        )

    return slipped


def _after(share: float) -> Callable[[FloatArray], FloatArray]:
    return lambda done: (done >= share).astype(np.float64)


def _before(share: float) -> Callable[[FloatArray], FloatArray]:
    return lambda done: (done < share).astype(np.float64)


def _push(force_n: tuple[float, float, float], begins_s: float, lasts_s: float) -> Change:
    def pushed(arm: ModifiedRun) -> Recording:
        acts = (arm.elapsed_s >= begins_s) & (arm.elapsed_s < begins_s + lasts_s)
        return arm.pushed(acts * np.array(force_n))

    return pushed


def _moving_base(angle_rad: float, frequency_hz: float) -> Change:
    """A base that tilts about its y axis, for ever or to and fro: the weights of payload and links turn with it."""

    def swayed(arm: ModifiedRun) -> Recording:
        x, _, z = arm.chain.gravity_m_s2
        way = np.sin(2.0 * np.pi * frequency_hz * arm.elapsed_s) if frequency_hz else 1.0
        return arm.plus(_LINKS_OVER_PAYLOAD * angle_rad * way * arm.of_weight(arm.payload, np.array([-z, 0.0, x])))

    return swayed


_LINKS_OVER_PAYLOAD: Final = 3.0
"""Torque of an arm's own weight, as a multiple of the payload's."""


def _late(seconds: float, joint: int | None = None, *, position: bool = False) -> Change:
    """Columns that belong to an earlier time."""

    def late(arm: ModifiedRun) -> Recording:
        time_s = arm.run.time_s

        def column(values: FloatArray) -> FloatArray:
            return np.asarray(np.interp(time_s - seconds, time_s, values))

        def whole(values: FloatArray) -> FloatArray:
            chosen = range(values.shape[1]) if joint is None else [joint]
            for each in chosen:
                values[:, each] = column(values[:, each])
            return values

        return arm.with_position(whole) if position else arm.with_effort(whole)

    return late


def _clock(factor: float) -> Change:
    return lambda arm: replace(arm.run, time_s=arm.run.time_s[0] + factor * (arm.run.time_s - arm.run.time_s[0]))


def _sampled_at(rate_hz: float) -> Change:
    """The rows nearest to a lower rate, without their phase, as from a slow logger."""

    def sampled(arm: ModifiedRun) -> Recording:
        time_s = arm.run.time_s
        wanted = np.arange(time_s[0], time_s[-1], 1.0 / rate_hz)
        rows = np.unique(np.searchsorted(time_s, wanted).clip(0, time_s.size - 1))
        return _without_phase(arm.run.rows(rows))

    return sampled


def _without_phase(run: Recording) -> Recording:
    return replace(run, phase_s=None, excitation=None)


def _gaps(arm: ModifiedRun) -> Recording:
    """Five holes of half a second."""
    centres = np.linspace(0.1, 0.9, 5) * float(arm.elapsed_s[-1, 0])
    hole = np.asarray((np.abs(arm.elapsed_s - centres) < 0.25).any(axis=1))
    return arm.run.rows(np.flatnonzero(~hole))


def _jitter(arm: ModifiedRun) -> Recording:
    """Stamps that are up to 40 % of an interval late."""
    step_s = float(np.median(np.diff(arm.run.time_s)))
    late_s = 0.4 * step_s * np.random.default_rng(1).random(arm.run.time_s.size)
    return replace(arm.run, time_s=arm.run.time_s + late_s)


def _repeated(count: int) -> Change:
    """Each value of the effort is held for some rows."""

    def held(arm: ModifiedRun) -> Recording:
        index = np.arange(arm.run.time_s.size) // count * count
        return arm.with_effort(lambda effort: effort[index])

    return held


def _stuck(joint: int, begin: float, end: float) -> Change:
    """One effort that stays at its value for a part of the run."""

    def stuck(arm: ModifiedRun) -> Recording:
        first, last = (int(share * arm.run.time_s.size) for share in (begin, end))

        def column(values: FloatArray) -> FloatArray:
            values[first:last] = values[first]
            return values

        return arm.with_effort(_on(joint, column))

    return stuck


def _clipped(joint: int, share: float) -> Change:
    def column(values: FloatArray) -> FloatArray:
        bound = share * float(np.abs(values).max())
        return np.clip(values, -bound, bound)

    return lambda arm: arm.with_effort(_on(joint, column))


def _rounded(share: float) -> Change:
    def whole(values: FloatArray) -> FloatArray:
        step = share * np.ptp(values, axis=0)
        return np.asarray(np.rint(values / step) * step)

    return lambda arm: arm.with_effort(whole)


def _offset(joint: int, share: float) -> Change:
    return lambda arm: arm.with_effort(_on(joint, lambda column: column + share * float(np.ptp(column))))


def _noisy(arm: ModifiedRun) -> Recording:
    """White noise of a tenth of each effort's size."""
    rng = np.random.default_rng(2)
    return arm.with_effort(lambda effort: effort + 0.1 * effort.std(axis=0) * rng.standard_normal(effort.shape))


def _spikes(arm: ModifiedRun) -> Recording:
    """One row of a hundred is five times as great."""
    rng = np.random.default_rng(3)
    return arm.with_effort(lambda effort: np.where(rng.random((len(effort), 1)) < 0.01, 5.0 * effort, effort))


def _friction(share: Callable[[FloatArray], FloatArray], *, viscous: bool = False) -> Change:
    """More friction: a share of the payload's torque on each joint, at least a twentieth of the greatest one's."""

    def rubbing(arm: ModifiedRun) -> Recording:
        speed = arm.states.velocity_rad_s
        level = np.maximum(arm.size_nm, 0.05 * arm.size_nm.max())
        peak = np.abs(speed).max(axis=0)
        law = speed / peak if viscous else np.tanh(speed / (0.01 * peak))
        return arm.plus(share(arm.share) * level * law)

    return rubbing


def _blow(arm: ModifiedRun) -> Recording:
    """An impact of a tenth of a second, 200 N downwards."""
    return _push((0.0, 0.0, -200.0), 0.4 * float(arm.elapsed_s[-1, 0]), 0.1)(arm)


def _degrees(joint: int) -> Change:
    return lambda arm: arm.with_position(_on(joint, np.degrees))


def _zero_off(joint: int, degrees: float) -> Change:
    return lambda arm: arm.with_position(_on(joint, lambda column: column + np.radians(degrees)))


LOADED, BOTH = Acts.LOADED, Acts.BOTH

MODIFICATIONS: Final = (
    Modification("hose at the wrist (joint 5), 5 % of the payload's torque", LOADED, _drag(4, 0.05)),
    Modification("hose at the wrist, in both runs", BOTH, _drag(4, 0.05)),
    Modification("hose at the forearm (joint 3), 5 %", LOADED, _drag(2, 0.05)),
    Modification("hose at the forearm, 20 %", LOADED, _drag(2, 0.2)),
    Modification("hose at the shoulder (joint 2), 5 %", LOADED, _drag(1, 0.05)),
    Modification("push downwards, 30 N for 2 s", LOADED, _push((0.0, 0.0, -30.0), 6.0, 2.0)),
    Modification("push sideways, 50 N for 3 s", LOADED, _push((0.0, 50.0, 0.0), 5.0, 3.0)),
    Modification(
        "something pulls down all the time, 5 N", LOADED, _push((0.0, 0.0, -5.0), 0.0, 1e9), hangs_kg=5.0 / 9.81
    ),
    Modification("something pulls sideways all the time, 10 N", LOADED, _push((10.0, 0.0, 0.0), 0.0, 1e9)),
    Modification("impact, 200 N for 0.1 s", LOADED, _blow),
    Modification("base sways by 0.5 deg at 0.3 Hz", LOADED, _moving_base(np.radians(0.5), 0.3)),
    Modification("base tilted by 0.5 deg between the runs", LOADED, _moving_base(np.radians(0.5), 0.0)),
    Modification("a tenth of the payload lost halfway", LOADED, _changed_payload(_scaled(0.9), _after(0.5)), True),
    Modification("0.3 kg lost halfway", LOADED, _changed_payload(_lighter(0.3), _after(0.5)), True),
    Modification("0.3 kg gained after a third", LOADED, _changed_payload(_lighter(-0.3), _after(0.33)), True),
    Modification("all dropped after three quarters", LOADED, _changed_payload(_scaled(0.0), _after(0.75)), True),
    Modification("grasped after a fifth", LOADED, _changed_payload(_scaled(0.0), _before(0.2)), True),
    Modification("a fifth of the payload leaks away", LOADED, _changed_payload(_scaled(0.8), lambda done: done), True),
    Modification(
        "slips 20 mm sideways halfway", LOADED, _changed_payload(_slipped((0.02, 0.0, 0.0)), _after(0.5)), True
    ),
    Modification(
        "slips 20 mm outwards halfway", LOADED, _changed_payload(_slipped((0.0, 0.0, 0.02)), _after(0.5)), True
    ),
    Modification("clock of the loaded run 2 % fast", LOADED, _clock(1.02)),
    Modification("clock 2 % fast", BOTH, _clock(1.02)),
    Modification("current of joint 3 is 50 ms late", BOTH, _late(0.05, 2)),
    Modification("current of joint 2 is 50 ms late", LOADED, _late(0.05, 1)),
    Modification("all currents are 50 ms late", BOTH, _late(0.05)),
    Modification("positions are 20 ms late", LOADED, _late(0.02, position=True)),
    Modification("stamps jitter by 40 % of an interval", BOTH, _jitter),
    Modification("five gaps of 0.5 s", LOADED, _gaps),
    Modification("loaded run sampled at 21 Hz", LOADED, _sampled_at(21.0)),
    Modification("loaded run sampled at 50 Hz", LOADED, _sampled_at(50.0)),
    Modification("both runs sampled at 21 Hz", BOTH, _sampled_at(21.0)),
    Modification("every current is repeated five times", LOADED, _repeated(5)),
    Modification("position of joint 5 in degrees", BOTH, _degrees(4)),
    Modification("current of joint 5 in mA", BOTH, _times(1000.0, 4)),
    Modification("currents of joints 2 and 3 exchanged", BOTH, lambda arm: arm.with_effort(_columns({1: 2, 2: 1}))),
    Modification("currents of joints 2 and 3 exchanged", LOADED, lambda arm: arm.with_effort(_columns({1: 2, 2: 1}))),
    Modification("positions of joints 4 and 6 exchanged", BOTH, lambda arm: arm.with_position(_columns({3: 5, 5: 3}))),
    Modification("sign of joint 3's current", BOTH, _times(-1.0, 2)),
    Modification("sign of joint 5's current", LOADED, _times(-1.0, 4)),
    Modification("current of joint 3 stuck for half of the run", LOADED, _stuck(2, 0.3, 0.8)),
    Modification("current of joint 2 stuck for 3 % of the run", LOADED, _stuck(1, 0.5, 0.53)),
    Modification("current of joint 3 is 0", LOADED, _times(0.0, 2)),
    Modification("gain of joint 6 doubled", BOTH, _times(0.5, 5)),
    Modification("gain of joint 2 doubled", BOTH, _times(0.5, 1)),
    Modification("gain of joint 3 10 % off", BOTH, _times(1.1, 2)),
    Modification("gain of joint 3 10 % off in one run", LOADED, _times(1.1, 2)),
    Modification("all gains drift by 1 %", LOADED, _times(1.01)),
    Modification("all gains drift by 5 %", LOADED, _times(1.05)),
    Modification("current of joint 2 saturates at 80 %", LOADED, _clipped(1, 0.8)),
    Modification("currents rounded to 2 % of their range", BOTH, _rounded(0.02)),
    Modification("offset of joint 2, 3 % of its range", LOADED, _offset(1, 0.03)),
    Modification("noise, a tenth of the current", BOTH, _noisy),
    Modification("one row of a hundred is five times as great", LOADED, _spikes),
    Modification("more friction, 20 % of the payload's torque", LOADED, _friction(lambda done: 0.0 * done + 0.2)),
    Modification(
        "friction falls by 20 % of the payload's torque", LOADED, _friction(lambda done: 0.2 * np.exp(-3.0 * done))
    ),
    Modification("viscous friction falls by 20 %", LOADED, _friction(lambda done: 0.2 * (1.0 - done), viscous=True)),
    Modification("zero of joint 4 off by 1 deg", BOTH, _zero_off(3, 1.0)),
    Modification("zero of joint 2 off by 1 deg in one run", LOADED, _zero_off(1, 1.0)),
)
"""All of them, with at least 40 on each arm."""
