"""Excitation design compared with the method of other open tools, on the same arm with the same limits.

Open tools use a method such as SciPy's SLSQP over Pinocchio's regressor, minimising the condition number on a grid,
with finite differences for the derivatives of criterion and limits (FIGAROH and FloBaRoID do the same with other
solvers and splines or Fourier series; FIGAROH itself is measured by `make peers`). This peer has the same limits on its
grid (joints, torque of the heaviest payload, every sphere's clearance), starts from the best of several random motions,
and has a limited number of iterations; its final result is printed with its violation of the limits. Times are CPU
times.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter, process_time

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from armload_controller.analysis.robot_excitation import POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE
from armload_controller.config.robot import Robot, load_robot
from armload_identification.excitation.design import DesignResult, optimal_excitation
from armload_identification.excitation.design_envelope import CLEARANCE_SCALE_M, Envelope
from armload_identification.excitation.design_search import PeriodRange, SearchSettings
from armload_identification.excitation.fourier import FourierTrajectory, fourier_basis
from armload_identification.excitation.geometry.workspace import Workspace
from armload_identification.excitation.information import condition_number, named_criterion
from armload_identification.float_array import FloatArray
from benchmarks.timing.regressor_time import ORDER, pinocchio_model

ROBOT = "er50"
HARMONICS = 5
PERIOD_S = 10.0
RESTARTS = 8
SEED = 1
PEER_ITERATIONS = 150
PEER_SAMPLES = 60
PEER_DRAWS = 50


def run() -> None:
    """Print the complete design, then one start compared with the peer's."""
    robot = load_robot(ROBOT)
    envelope = robot.envelope(POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE)
    cores = len(os.sched_getaffinity(0))
    print(
        f"Excitation design, {ROBOT}: {robot.n} joints, {HARMONICS} harmonics, {PERIOD_S:g} s, joints, torque, "
        f"{len(envelope.workspace.names)} clearances"
    )
    started, used = perf_counter(), _children_s()
    with ProcessPoolExecutor(cores, mp_context=get_context("spawn")) as executor:
        result = _ours(robot, envelope, "a-optimal", RESTARTS, executor)
    took_s = perf_counter() - started
    used_s = _children_s() - used
    spread = np.sort(result.restart_costs)
    print(
        f"  a-optimal, {RESTARTS} restarts in {cores} processes, their start included: {used_s:.1f} s of processor, "
        f"{used_s / cores:.1f} s on each core; {took_s:.1f} s by the clock on the machine as it was"
    )
    print(f"  cost {result.cost:.4g}, the others' {spread[1]:.4g} to {spread[-1]:.4g}; strictly within every limit")
    print(f"\nOne start for the condition number, one process; the peer is stopped after {PEER_ITERATIONS} iterations")
    started = process_time()
    ours = _ours(robot, envelope, "condition-number", 1, None)
    ours_s = process_time() - started
    with threadpool_limits(1):
        peer = Peer(robot, envelope)
        started = process_time()
        found = peer.solve()
        peer_s = process_time() - started
    for name, cost, time_s, worst in (
        ("armload", ours.cost, ours_s, envelope.worst(ours.trajectory).max()),
        ("SLSQP over Pinocchio's regressor", peer.cost_of(found), peer_s, envelope.worst(found).max()),
    ):
        kept = "every limit kept at any time" if worst <= 0.0 else f"limits exceeded by up to {100.0 * worst:.1f} %"
        print(f"  {name:45s} cond {cost:6.2f}  {time_s:7.2f} s  {time_s / ours_s:5.1f} x   {kept}")


def _children_s() -> float:
    """CPU time of all child processes that have ended, s."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _ours(
    robot: Robot, envelope: Envelope, criterion: str, restarts: int, executor: ProcessPoolExecutor | None
) -> DesignResult:
    chosen = named_criterion(criterion, robot.chain, robot.limits.torque_noise_nm, robot.payloads.expected)
    return optimal_excitation(
        chosen,
        envelope,
        SearchSettings(HARMONICS, PeriodRange(PERIOD_S, PERIOD_S, PERIOD_S), SEED, restarts),
        executor=executor,
    )


class Peer:
    """The condition number minimised by SLSQP, with Pinocchio's model of the arm."""

    def __init__(self, robot: Robot, envelope: Envelope) -> None:
        chain = robot.chain
        self._n, self._envelope = chain.n, envelope
        self._model, self._flange = pinocchio_model(chain), pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3])
        self._data = self._model.createData()
        payload = envelope.torque.payload
        self._loaded = self._model.copy()
        body = pin.Inertia(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
        self._loaded.inertias[chain.n] = self._flange.act(body)
        times_s = np.arange(PEER_SAMPLES) * (PERIOD_S / PEER_SAMPLES)
        self._basis = fourier_basis(1.0 / PERIOD_S, HARMONICS, times_s)
        limits = envelope.joints
        omega = 2.0 * np.pi / PERIOD_S * np.arange(1, HARMONICS + 1)
        half = 0.5 * (limits.position_max_rad - limits.position_min_rad)
        reach = np.minimum(half[:, None], limits.velocity_max_rad_s[:, None] / np.r_[omega, omega])
        self._scale = np.column_stack([half, reach])
        self._middle = 0.5 * (limits.position_max_rad + limits.position_min_rad)
        self._sphere_link = [sphere.link for sphere in envelope.workspace.spheres]

    def solve(self) -> FourierTrajectory:
        """Optimise from the best of some random motions, up to the limit of iterations."""
        rng = np.random.default_rng(SEED)
        drawn = []
        for _ in range(PEER_DRAWS):
            x = rng.normal(size=self._scale.shape) * rng.uniform(0.2, 1.0) / np.sqrt(2.0 * HARMONICS)
            x[:, 0] = rng.uniform(-0.5, 0.5, self._n)
            drawn.append(x.ravel())
        start = min(drawn, key=lambda x: np.log(self._cost(x)) + 0.5 * np.sum(np.minimum(0.0, self._room(x)) ** 2))
        options = {"maxiter": PEER_ITERATIONS, "ftol": 1e-6}
        constraint = {"type": "ineq", "fun": self._room}
        return self._trajectory(minimize(self._cost, start, method="SLSQP", constraints=constraint, options=options).x)

    def cost_of(self, trajectory: FourierTrajectory) -> float:
        """The condition number on this project's finer grid."""
        state = trajectory.evaluate(np.linspace(0.0, PERIOD_S, 1000, endpoint=False))
        motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
        return condition_number(self._envelope.torque.chain).cost(*motion, PERIOD_S)

    def _states(self, x: FloatArray) -> FloatArray:
        coefficients = (x.reshape(self._scale.shape) * self._scale).T
        states = np.stack([basis @ coefficients for basis in self._basis])
        states[0] += self._middle
        return states

    def _cost(self, x: FloatArray) -> float:
        """cond(Phi)."""
        q, dq, ddq = self._states(x)[:3]
        phi = np.empty((PEER_SAMPLES, self._n, 10))
        for t in range(PEER_SAMPLES):
            pin.rnea(self._model, self._data, q[t], dq[t], ddq[t])  # leaves velocity and acceleration in data
            jacobian = pin.computeJointJacobian(self._model, self._data, q[t], self._n)
            phi[t] = jacobian.T @ pin.bodyRegressor(self._data.v[self._n], self._data.a_gf[self._n])
        return float(np.linalg.cond(phi.reshape(-1, 10)[:, ORDER]))

    def _room(self, x: FloatArray) -> FloatArray:
        """Relative margin to every limit at every sample; at least zero within the limits."""
        states, limits, workspace = self._states(x), self._envelope.joints, self._envelope.workspace
        half = 0.5 * (limits.position_max_rad - limits.position_min_rad)
        parts = [(states[0] - self._middle) / half]
        greatest = (limits.velocity_max_rad_s, limits.acceleration_max_rad_s2, limits.jerk_max_rad_s3)
        parts += [state / most for state, most in zip(states[1:], greatest, strict=True)]
        torque = [pin.rnea(self._loaded, self._data, *row) for row in zip(*states[:3], strict=True)]
        still = np.zeros(self._n)
        torque += [pin.rnea(self._loaded, self._data, q, still, still) for q in states[0]]
        parts.append(np.array(torque) / self._envelope.torque.available_nm)
        both = np.concatenate([part.ravel() for part in parts])
        centres = np.empty((PEER_SAMPLES, len(self._sphere_link), 3))
        for t, q in enumerate(states[0]):
            pin.forwardKinematics(self._model, self._data, q)
            poses = [pin.SE3.Identity(), *list(self._data.oMi)[1:], self._data.oMi[self._n] * self._flange]
            centres[t] = [poses[s.link].act(s.center_m) for s in workspace.spheres]
        near = [d - workspace.keep_m for d in _distances(workspace, centres)]
        return np.concatenate([1.0 - both, 1.0 + both, np.concatenate(near) / CLEARANCE_SCALE_M])

    def _trajectory(self, x: FloatArray) -> FourierTrajectory:
        coefficients = x.reshape(self._scale.shape) * self._scale
        return FourierTrajectory(
            1.0 / PERIOD_S,
            coefficients[:, 0] + self._middle,
            coefficients[:, 1 : 1 + HARMONICS],
            coefficients[:, 1 + HARMONICS :],
        )


def _distances(workspace: Workspace, centres: FloatArray) -> list[FloatArray]:
    """All clearances by numpy, from the spheres' centres (N, S, 3)."""
    links = np.array([s.link for s in workspace.spheres])
    radius = np.array([s.radius_m for s in workspace.spheres])
    found = []
    for wall in workspace.half_spaces:
        met = np.isin(links, wall.links)
        found.append((centres[:, met] @ wall.normal - wall.offset_m - radius[met]).ravel())
    for box in workspace.boxes:
        met = np.isin(links, box.links)
        beyond = np.abs((centres[:, met] - box.pose[:3, 3]) @ box.pose[:3, :3]) - 0.5 * box.size_m
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=2)
        found.append((outside + np.minimum(beyond.max(axis=2), 0.0) - radius[met]).ravel())
    for first, second in workspace.apart:
        a, b = np.flatnonzero(links == first), np.flatnonzero(links == second)
        between = np.linalg.norm(centres[:, a, None] - centres[:, None, b], axis=3)
        found.append((between - radius[a][:, None] - radius[b]).ravel())
    return found


if __name__ == "__main__":
    run()
