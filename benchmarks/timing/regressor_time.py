"""Regressor and feed-forward compared with Pinocchio's, on the same arm and the same states.

The kernels are timed with each instruction set of this processor. The rounds of all candidates are interleaved, so that
other load on the machine affects all of them; medians of this thread's CPU time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from statistics import median
from time import thread_time

import numpy as np
import pinocchio as pin

from armload_controller.config.robot import load_robot
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_core import kernels
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor

SAMPLES = 2000
BATCH_CALLS = 12
BATCH_ROUNDS = 9
SINGLE_CALLS = 2000
SINGLE_ROUNDS = 40
ORDER = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]  # Pinocchio's dynamic parameters in this project's order


def run() -> None:
    """Print both tables."""
    robot = load_robot("er50")
    chain, payload = robot.chain, robot.payloads.expected
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-1.5, 1.5, (3, SAMPLES, chain.n))
    model = pinocchio_model(chain)
    rounds = f"{BATCH_ROUNDS} x {BATCH_CALLS} calls"
    print(f"Regressor of the payload, {SAMPLES} samples of {chain.n} joints, er50; median of {rounds}")
    _batch(chain, model, q, dq, ddq)
    print(f"\nInformation matrix of the payload, {SAMPLES} samples of {chain.n} joints, er50; median of {rounds}")
    print(f"\nFeed-forward, one sample of {chain.n} joints; median of {SINGLE_ROUNDS} x {SINGLE_CALLS} calls")
    _single(chain, payload, model, q[0], dq[0], ddq[0])


def _batch(chain: Chain, model: pin.Model, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> None:
    data = model.createData()
    last = slice(10 * (chain.n - 1), 10 * chain.n)

    def ours(variant: str) -> np.ndarray:
        kernels.use_variant(variant)
        return payload_regressor(chain, q, dq, ddq)

    def torque_regressor() -> np.ndarray:
        out = np.empty((SAMPLES, chain.n, 10))
        for t in range(SAMPLES):
            out[t] = pin.computeJointTorqueRegressor(model, data, q[t], dq[t], ddq[t])[:, last]
        return out

    def body_regressor() -> np.ndarray:
        out = np.empty((SAMPLES, chain.n, 10))
        for t in range(SAMPLES):
            pin.rnea(model, data, q[t], dq[t], ddq[t])  # leaves velocities, and accelerations with gravity, in data
            jacobian = pin.computeJointJacobian(model, data, q[t], chain.n)
            out[t] = jacobian.T @ pin.bodyRegressor(data.v[chain.n], data.a_gf[chain.n])
        return out

    candidates: dict[str, Callable[[], object]] = {
        **{f"armload payload_regressor, {variant}": partial(ours, variant) for variant in kernels.variants()},
        "Pinocchio loop, computeJointTorqueRegressor": torque_regressor,
        "Pinocchio loop, bodyRegressor and Jacobian": body_regressor,
    }
    times_s = _times(candidates, BATCH_ROUNDS, BATCH_CALLS)
    _print(candidates, times_s, min(times_s[-2:]), 1e3, "ms")
    worst = max(
        float(np.abs(ours(variant) - peer()[:, :, ORDER]).max())
        for variant in reversed(kernels.variants())
        for peer in (torque_regressor, body_regressor)
    )
    print(f"  greatest difference between them: {worst:.1e}")


def _single(
    chain: Chain, payload: InertialParameters, empty: pin.Model, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> None:
    loaded = empty.copy()
    center, inertia = payload.center_of_mass_m, payload.inertia_about_com
    body = pin.Inertia(payload.mass_kg, center, inertia)
    loaded.inertias[chain.n] = pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3]).act(body)
    empty_data, loaded_data = empty.createData(), loaded.createData()
    feedforward = PayloadFeedforward(chain, payload)

    def through_the_class() -> None:
        feedforward.torque_nm(q, dq, ddq)

    def two_rnea() -> np.ndarray:
        return np.asarray(pin.rnea(loaded, loaded_data, q, dq, ddq) - pin.rnea(empty, empty_data, q, dq, ddq))

    def two_rnea_alone() -> None:
        pin.rnea(loaded, loaded_data, q, dq, ddq)
        pin.rnea(empty, empty_data, q, dq, ddq)

    candidates: dict[str, Callable[[], object]] = {
        "armload PayloadFeedforward.torque_nm": through_the_class,
        "two pin.rnea, without the subtraction": two_rnea_alone,
        "two pin.rnea and their difference": two_rnea,
    }
    times_s = _times(candidates, SINGLE_ROUNDS, SINGLE_CALLS)
    _print(candidates, times_s, times_s[1], 1e6, "us")
    print(f"  greatest difference between them: {np.abs(feedforward.torque_nm(q, dq, ddq) - two_rnea()).max():.1e} N m")


def _times(candidates: dict[str, Callable[[], object]], rounds: int, calls: int) -> list[float]:
    """Median duration of one call of each, in s."""
    seconds: list[list[float]] = [[] for _ in candidates]
    for _ in range(rounds):
        for candidate, durations in zip(candidates.values(), seconds, strict=True):
            started = thread_time()
            for _ in range(calls):
                candidate()
            durations.append((thread_time() - started) / calls)
    return [median(durations) for durations in seconds]


def _print(
    candidates: dict[str, Callable[[], object]], times_s: list[float], peer_s: float, scale: float, unit: str
) -> None:
    """Print the time of each, and its speed relative to the peer's."""
    for name, time_s in zip(candidates, times_s, strict=True):
        print(f"  {name:45s} {time_s * scale:8.3f} {unit}   {peer_s / time_s:5.1f} x")


def pinocchio_model(chain: Chain) -> pin.Model:
    """The arm in Pinocchio, without masses; the flange must be the last joint's frame.

    Raises:
        ValueError: the flange is elsewhere.
    """
    if not np.allclose(chain.flange, np.eye(4)):
        raise ValueError("the comparison needs an arm whose flange is its last joint's frame")
    model = pin.Model()
    model.gravity = pin.Motion(chain.gravity_m_s2, np.zeros(3))
    joint = 0
    for i in range(chain.n):
        pose = pin.SE3(chain.placement[i][:3, :3], chain.placement[i][:3, 3])
        joint = model.addJoint(
            joint,
            pin.JointModelRZ() if chain.axis[i][2] == 1.0 else pin.JointModelRevoluteUnaligned(chain.axis[i]),
            pose,
            f"joint_{i + 1}",
        )
    return model


if __name__ == "__main__":
    run()
