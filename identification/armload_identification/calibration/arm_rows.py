"""One run of an arm as equations: its motion, its motors' effort, and the columns of the arm's unknowns.

Positions and efforts pass through the same zero-phase low-pass, so that the model's torque for the filtered motion is
comparable with the filtered effort; the direction of motion, which is not smooth, is filtered as well. Whole periods of
a known excitation are averaged first. Filter, delay and rate hardly matter: on the UR10e, cutoff frequencies from 2.5
to 6 Hz and 10 or 20 rows per second change the gains by less than 0.1 %.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, body_regressor, payload_regressor
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.phases import phases_per_period, whole_periods
from armload_identification.signals.filters import low_pass
from armload_identification.signals.joint_torque import Transmission, joint_torque
from armload_identification.signals.periods import fold

CUTOFF_HZ: Final = 4.0
_FINE_S: Final = 0.01
_ROW_S: Final = 0.1
_MOST_ROWS: Final = 1500
"""Most rows of one run; in a longer one they are further apart."""
_HOLE_S: Final = 0.1
_EDGE_S: Final = 0.3
"""Time at both ends of a run that is excluded because of the filter's transient."""
_TURN_OVER: Final = 0.01
"""Speed that smooths the direction of motion, as a share of a joint's greatest speed."""
_REVERSAL: Final = 0.10
"""Share of a joint's greatest speed at which a row's weight is 0.7: near a reversal no friction model is accurate."""
_STANDS_RAD_S: Final = 1e-3
_DELAY_STEP_S: Final = 0.004
_SHORTEST_S: Final = 3.0
_PERIODS_FOR_FILTER: Final = 3
_TILTED: Final = 0.9


@dataclass(frozen=True, eq=False)
class RunSignals:
    """A run on an equidistant time grid, low-passed, n joints.

    Attributes:
        name: Name of the run in messages.
        interval_s: Time between samples.
        position_rad: (K, n).
        velocity_rad_s: (K, n).
        acceleration_rad_s2: (K, n).
        effort_nm: (K, n) axis torque from the currents with nominal gains, C^T tau.
        usable: (K,) False in gaps and at the ends.
        periodic: Whether the last sample is followed by the first.
        from_torque: Whether the drives reported torque instead of current.
    """

    name: str
    interval_s: float
    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    effort_nm: FloatArray
    usable: NDArray[np.bool_]
    periodic: bool
    from_torque: bool

    @property
    def peak_rad_s(self) -> FloatArray:
        """(n,) greatest speeds."""
        return np.asarray(np.abs(self.velocity_rad_s).max(axis=0))

    def turned(self, axis: int, coupling: FloatArray, *, position: bool, effort: bool) -> RunSignals:
        """The same run with one axis inverted.

        Args:
            axis: Index of the axis.
            coupling: (n, n) C of the motors.
            position: Whether its position is inverted.
            effort: Whether its effort is inverted.
        """
        turn = np.ones(len(coupling))
        turn[axis] = -1.0
        joints = coupling * turn @ np.linalg.inv(coupling) if position else np.eye(turn.size)
        return replace(
            self,
            position_rad=self.position_rad @ joints.T,
            velocity_rad_s=self.velocity_rad_s @ joints.T,
            acceleration_rad_s2=self.acceleration_rad_s2 @ joints.T,
            effort_nm=self.effort_nm * turn if effort else self.effort_nm,
        )

    def filtered(self, values: FloatArray) -> FloatArray:
        """(K, m) values after the same low-pass as the run's signals."""
        return _filtered(values, self.interval_s, self.periodic)


@dataclass(frozen=True, eq=False)
class ArmRows:
    """N rows of a run of n joints with b base parameters.

    Attributes:
        name: Name of the run in messages.
        time_s: (N,) time since the start.
        velocity_rad_s: (N, n).
        axis_acceleration_rad_s2: (N, n) C^-1 ddq.
        axis_jerk_rad_s3: (N, n) its change per second of delay of the torque.
        direction: (N, n) direction of motion, -1 to 1, low-passed.
        root: (N, n) direction times sqrt|dq|.
        effort_nm: (N, n) axis torque with nominal gains.
        weight: (N, n) 0 at a reversal, 1 far from it.
        links: (N, n, b) joint torque per base parameter of the links.
        links_rate: (N, n, b) its change per second of delay.
        links_tilt: (2, N, n, b) its change per rad of tilt of the base.
        payload: (N, n, 10) joint torque per parameter of a payload.
        payload_rate: (N, n, 10) its change per second of delay.
        payload_tilt: (2, N, n, 10) its change per rad of tilt.
    """

    name: str
    time_s: FloatArray
    velocity_rad_s: FloatArray
    axis_acceleration_rad_s2: FloatArray
    axis_jerk_rad_s3: FloatArray
    direction: FloatArray
    root: FloatArray
    effort_nm: FloatArray
    weight: FloatArray
    links: FloatArray
    links_rate: FloatArray
    links_tilt: FloatArray
    payload: FloatArray
    payload_rate: FloatArray
    payload_tilt: FloatArray

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.effort_nm.shape[1])


def run_signals(recording: Recording, transmission: Transmission) -> RunSignals:
    """Motion and effort of one run.

    Args:
        recording: The run.
        transmission: Nominal gains, and coupling.

    Returns:
        The average period of a run with whole periods, else the entire run.

    Raises:
        RecordingError: too short, or without torque.
    """
    from scipy.ndimage import binary_dilation

    name = str(recording.source.path)
    effort = joint_torque(recording, transmission) @ transmission.coupling
    from_torque = recording.torque_nm is not None
    if whole_periods(recording):
        return _folded(recording, effort, name, from_torque)
    time_s = recording.time_s - recording.time_s[0]
    grid = np.arange(int(time_s[-1] / _FINE_S)) * _FINE_S
    if grid.size * _FINE_S < _SHORTEST_S:
        raise RecordingError(
            f"{name}: {time_s[-1]:.1f} s long, expected {_SHORTEST_S:g} s or more. Record a whole excitation."
        )
    position, even = (
        np.column_stack([np.interp(grid, time_s, column) for column in values.T])
        for values in (recording.position_rad, effort)
    )
    position = _filtered(position, _FINE_S, periodic=False)
    after = np.clip(np.searchsorted(time_s, grid), 1, time_s.size - 1)
    hole = binary_dilation(time_s[after] - time_s[after - 1] > _HOLE_S, iterations=round(_HOLE_S / _FINE_S))
    edge = round(_EDGE_S / _FINE_S)
    usable = ~hole
    usable[:edge] = usable[-edge:] = False
    velocity = np.gradient(position, _FINE_S, axis=0)
    return RunSignals(
        name=name,
        interval_s=_FINE_S,
        position_rad=position,
        velocity_rad_s=velocity,
        acceleration_rad_s2=np.gradient(velocity, _FINE_S, axis=0),
        effort_nm=_filtered(even, _FINE_S, periodic=False),
        usable=usable,
        periodic=False,
        from_torque=from_torque,
    )


def _folded(recording: Recording, effort: FloatArray, name: str, from_torque: bool) -> RunSignals:
    """The average period."""
    run = fold(recording, effort, phases_per_period(recording))
    interval_s = run.period_s / len(run.torque_nm)
    motion = run.motion.evaluate(np.arange(len(run.torque_nm)) * interval_s)
    states = (motion.position_rad, motion.velocity_rad_s, motion.acceleration_rad_s2)
    position, velocity, acceleration, average = (
        _filtered(values, interval_s, periodic=True) for values in (*states, run.torque_nm)
    )
    return RunSignals(
        name=name,
        interval_s=interval_s,
        position_rad=position,
        velocity_rad_s=velocity,
        acceleration_rad_s2=acceleration,
        effort_nm=average,
        usable=run.valid,
        periodic=True,
        from_torque=from_torque,
    )


def _filtered(values: FloatArray, interval_s: float, periodic: bool) -> FloatArray:
    """Zero-phase low-pass; a period is continued periodically at both ends."""
    if not periodic:
        return low_pass(values, interval_s, CUTOFF_HZ)
    length = len(values)
    return low_pass(np.tile(values, (_PERIODS_FOR_FILTER, 1)), interval_s, CUTOFF_HZ)[length : 2 * length]


def arm_rows(
    run: RunSignals,
    chain: Chain,
    coupling: FloatArray,
    base: NDArray[np.bool_],
    peak_rad_s: FloatArray,
    *,
    loaded: bool,
    spacing: int = 1,
) -> ArmRows:
    """The equations of a run.

    Args:
        run: Its signals.
        chain: The arm as configured, without tilt.
        coupling: (n, n) C of its motors.
        base: (10 n,) True for the base parameters of the links.
        peak_rad_s: (n,) greatest speed of each joint over all runs.
        loaded: Whether a payload's columns are required.
        spacing: Keep every `spacing`-th row.

    Returns:
        Rows 0.1 s times `spacing` apart, or further in a long run.
    """
    moves = peak_rad_s > _STANDS_RAD_S
    scale = np.where(moves, peak_rad_s, 1.0)
    sign = np.where(moves, np.tanh(run.velocity_rad_s / (_TURN_OVER * scale)), 0.0)
    direction = run.filtered(sign)
    root = run.filtered(sign * np.sqrt(np.abs(run.velocity_rad_s)))
    length_s = len(run.usable) * run.interval_s
    step = max(round(max(_ROW_S, length_s / _MOST_ROWS) / run.interval_s), 1) * spacing
    kept = np.arange(step // 2, len(run.usable), step)
    kept = kept[run.usable[kept]]
    now, then = _states(run, kept, 0.0), _states(run, kept, _DELAY_STEP_S)
    still = np.zeros_like(now[0])
    sides = sideways(chain)
    links = body_regressor(chain, *now)[:, :, base]
    ratio = (run.velocity_rad_s[kept] / (_REVERSAL * scale)) ** 2
    to_axis = np.linalg.inv(coupling).T
    acceleration = now[2] @ to_axis
    nothing = np.zeros((len(kept), run.effort_nm.shape[1], 0))
    payload = payload_regressor(chain, *now) if loaded else nothing
    return ArmRows(
        name=run.name,
        time_s=np.asarray(kept * run.interval_s, dtype=np.float64),
        velocity_rad_s=now[1],
        axis_acceleration_rad_s2=acceleration,
        axis_jerk_rad_s3=(then[2] @ to_axis - acceleration) / _DELAY_STEP_S,
        direction=direction[kept],
        root=root[kept],
        effort_nm=run.effort_nm[kept],
        weight=np.where(moves, ratio / np.sqrt(1.0 + ratio**2), 0.0),
        links=links,
        links_rate=(body_regressor(chain, *then)[:, :, base] - links) / _DELAY_STEP_S,
        links_tilt=np.stack([body_regressor(side, now[0], still, still)[:, :, base] for side in sides]),
        payload=payload,
        payload_rate=(payload_regressor(chain, *then) - payload) / _DELAY_STEP_S if loaded else nothing,
        payload_tilt=np.stack([payload_regressor(side, now[0], still, still) if loaded else nothing for side in sides]),
    )


def tilt_axes(gravity_m_s2: FloatArray) -> FloatArray:
    """Two directions perpendicular to gravity, in which it tilts if the base is not level.

    Args:
        gravity_m_s2: (3,) gravity in the base frame.

    Returns:
        (2, 3) orthogonal unit vectors.
    """
    down = gravity_m_s2 / np.sqrt(np.sum(gravity_m_s2**2))
    other = np.eye(3)[0] if abs(down[0]) < _TILTED else np.eye(3)[1]
    first = np.cross(down, other)
    first /= np.sqrt(np.sum(first**2))
    return np.stack([first, np.cross(down, first)])


@lru_cache(maxsize=8)
def sideways(chain: Chain) -> tuple[Chain, ...]:
    """The arm with gravity along each tilt axis only: the effect of one rad of tilt.

    Args:
        chain: The arm.
    """
    size = float(np.sqrt(np.sum(chain.gravity_m_s2**2)))
    return tuple(
        Chain(chain.placement, chain.axis, chain.flange, size * axis) for axis in tilt_axes(chain.gravity_m_s2)
    )


def _states(run: RunSignals, kept: NDArray[np.intp], delay_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration `delay_s` earlier."""
    q, dq, ddq = (values[kept] for values in (run.position_rad, run.velocity_rad_s, run.acceleration_rad_s2))
    jerk = np.gradient(run.acceleration_rad_s2, run.interval_s, axis=0)[kept]
    half = 0.5 * delay_s**2
    return q - delay_s * dq + half * ddq, dq - delay_s * ddq + half * jerk, ddq - delay_s * jerk


def base_links(base: NDArray[np.bool_], n: int) -> NDArray[np.bool_]:
    """(10 n,) flags of the links from (11 n,) of links and rotors."""
    return np.asarray(base[: PARAMETERS * n])
