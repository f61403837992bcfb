"""The model of a calibration: axis torque with nominal gains as a function of all unknowns of an arm.

    y = h C^T [tau + mu s |tau| + Fc s + Fv dq + Fs s sqrt|dq| + (changes of the run)] + h I_r C^-1 ddq,
    tau = Y(q, dq, ddq) beta + Phi(q, dq, ddq) theta,      h = nominal gain / gain

with s the direction of motion. Common to all runs are log h, the links' base parameters beta, the rotors I_r, mu,
friction, one delay of the torque and two tilt angles of the base; common to the runs of one mounting are the ten
parameters theta. Every run has its own changes of Coulomb and viscous friction, which drift as an arm warms up, and of
the offset.

Load-dependent friction is linear in |tau|. On the UR10e |tau|^1.5 reduces the residual of joint 2 by 18 %, but does not
improve gains and payloads.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.calibration.arm_rows import ArmRows
from armload_identification.model.regressor import PARAMETERS

PER_RUN = 3
"""Changes of a run per joint: Coulomb, viscous, offset."""


@dataclass(frozen=True)
class Unknowns:
    """Layout of the vector x of all shared unknowns, and of a calibration's covariance, which has the arm's part of it.

    A calibration's file does not name the parts: in another order, existing files would be read wrongly.

    Attributes:
        n: Number of joints.
        base: Number of base parameters of the links.
        mountings: Names of the mountings, one payload each.
        log_h: (n) ln(nominal gain / gain).
        links: (base) base parameters.
        rotors: (n) kg m2.
        load: (n) mu.
        coulomb: (n) N m.
        viscous: (n) N m s/rad.
        root: (n) N m per sqrt(rad/s).
        delay: (1) s.
        tilt: (2) rad.
    """

    n: int
    base: int
    mountings: tuple[str, ...]
    log_h: slice = field(init=False)
    links: slice = field(init=False)
    rotors: slice = field(init=False)
    load: slice = field(init=False)
    coulomb: slice = field(init=False)
    viscous: slice = field(init=False)
    root: slice = field(init=False)
    delay: slice = field(init=False)
    tilt: slice = field(init=False)

    def __post_init__(self) -> None:
        start = 0
        n = self.n
        sizes = {"log_h": n, "links": self.base, "rotors": n, "load": n, "coulomb": n, "viscous": n, "root": n}
        for name, size in (sizes | {"delay": 1, "tilt": 2}).items():
            object.__setattr__(self, name, slice(start, start + size))
            start += size

    @property
    def arm(self) -> int:
        """Length of the arm's part, which the payloads follow."""
        return int(self.tilt.stop)

    @property
    def size(self) -> int:
        """Length of x."""
        return self.arm + PARAMETERS * len(self.mountings)

    def payload(self, mounting: str) -> slice:
        """Indices of the ten parameters of a mounting."""
        start = self.arm + PARAMETERS * self.mountings.index(mounting)
        return slice(start, start + PARAMETERS)


@dataclass(frozen=True, eq=False)
class RunDerivatives:
    """Predicted torque of a run and its derivatives, for N rows.

    Attributes:
        predicted_nm: (N, n) axis torque with nominal gains.
        columns: Per axis (N, k) derivatives.
        place: Per axis (k,) indices of their unknowns; the run's own changes follow x.
    """

    predicted_nm: FloatArray
    columns: tuple[FloatArray, ...]
    place: tuple[NDArray[np.intp], ...]


class ArmModel:
    """Predictions and derivatives.

    Args:
        unknowns: The layout.
        coupling: (n, n) C of the motors.
    """

    def __init__(self, unknowns: Unknowns, coupling: FloatArray) -> None:
        self.unknowns, self._coupling = unknowns, coupling
        self._joints = [np.flatnonzero(column) for column in coupling.T]

    def predict(self, rows: ArmRows, mounting: str, x: FloatArray, changes: FloatArray) -> FloatArray:
        """Axis torque with nominal gains.

        Args:
            rows: The run.
            mounting: Name of its payload; empty for an empty arm.
            x: All shared unknowns.
            changes: (3 n,) the run's own changes of friction.

        Returns:
            (N, n) in N m.
        """
        of = self.unknowns
        delay, tilt = x[of.delay][0], x[of.tilt]
        links = x[of.links]
        tau = _moved(rows.links @ links, rows.links_rate @ links, rows.links_tilt @ links, delay, tilt)
        if mounting:
            theta = x[of.payload(mounting)]
            tau += _moved(rows.payload @ theta, rows.payload_rate @ theta, rows.payload_tilt @ theta, delay, tilt)
        return self._axis_torque(rows, tau, x, changes)

    def differentiate(self, rows: ArmRows, mounting: str, x: FloatArray, changes: FloatArray) -> RunDerivatives:
        """The prediction with its derivatives; arguments as in `predict`."""
        of, n = self.unknowns, rows.n
        delay, tilt = x[of.delay][0], x[of.tilt]
        links = _moved(rows.links, rows.links_rate, rows.links_tilt, delay, tilt)
        payload = _moved(rows.payload, rows.payload_rate, rows.payload_tilt, delay, tilt) if mounting else rows.payload
        tau = links @ x[of.links] + (payload @ x[of.payload(mounting)] if mounting else 0.0)
        predicted = self._axis_torque(rows, tau, x, changes)
        h, load = np.exp(x[of.log_h]), x[of.load]
        delay_torque = rows.links_rate @ x[of.links]
        tilt_torque = rows.links_tilt @ x[of.links]
        if mounting:
            theta = x[of.payload(mounting)]
            delay_torque = delay_torque + rows.payload_rate @ theta
            tilt_torque = tilt_torque + rows.payload_tilt @ theta
        factor = 1.0 + load * rows.direction * np.sign(tau)
        whole = [links, delay_torque[:, :, None], np.moveaxis(tilt_torque, 0, 2)]
        place = [np.arange(of.links.start, of.links.stop), np.arange(of.delay.start, of.tilt.stop)]
        if mounting:
            whole.append(payload)
            place.append(np.arange(of.payload(mounting).start, of.payload(mounting).stop))
        through = np.concatenate(whole, axis=2) * factor[:, :, None]
        own = np.stack(
            [
                rows.direction * np.abs(tau),
                rows.direction,
                rows.velocity_rad_s,
                rows.root,
                rows.direction,
                rows.velocity_rad_s,
                np.ones_like(tau),
            ],
            axis=2,
        )
        starts = np.array([of.load.start, of.coulomb.start, of.viscous.start, of.root.start])
        starts = np.concatenate([starts, of.size + n * np.arange(PER_RUN)])
        columns, places = [], []
        for axis, joints in enumerate(self._joints):
            share = self._coupling[joints, axis] * h[axis]
            ahead = (
                np.einsum("tjk,j->tk", through[:, joints], share)
                if joints.size > 1
                else (through[:, joints[0]] * share[0])
            )
            rotor = h[axis] * rows.axis_acceleration_rad_s2[:, axis]
            ahead[:, links.shape[2]] += h[axis] * rows.axis_jerk_rad_s3[:, axis] * x[of.rotors][axis]
            columns.append(
                np.column_stack(
                    [predicted[:, axis], rotor, ahead, *(own[:, j] * c for j, c in zip(joints, share, strict=True))]
                )
            )
            places.append(
                np.concatenate(
                    [[of.log_h.start + axis, of.rotors.start + axis], *place, *(starts + j for j in joints)]
                ).astype(np.intp)
            )
        return RunDerivatives(predicted, tuple(columns), tuple(places))

    def _axis_torque(self, rows: ArmRows, tau: FloatArray, x: FloatArray, changes: FloatArray) -> FloatArray:
        """(N, n) axis torque with nominal gains, from the joint torque of links and payload."""
        of = self.unknowns
        coulomb, viscous, offset = changes.reshape(PER_RUN, rows.n)
        friction = rows.direction * (x[of.coulomb] + coulomb + x[of.load] * np.abs(tau))
        friction += rows.velocity_rad_s * (x[of.viscous] + viscous) + rows.root * x[of.root] + offset
        acceleration = rows.axis_acceleration_rad_s2 + x[of.delay][0] * rows.axis_jerk_rad_s3
        axis_nm = (tau + friction) @ self._coupling + acceleration * x[of.rotors]
        return np.asarray(np.exp(x[of.log_h]) * axis_nm)


def _moved(level: FloatArray, rate: FloatArray, tilted: FloatArray, delay: float, tilt: FloatArray) -> FloatArray:
    """(N, n) torque, or its (N, n, k) columns, with delay and tilt of the base."""
    moved = level + delay * rate
    moved += tilt[0] * tilted[0]
    moved += tilt[1] * tilted[1]
    return np.asarray(moved)
