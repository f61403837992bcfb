"""A point-to-point motion of Pinocchio's arm."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.fixture(scope="session")
def jerky(pinocchio_arm):
    """Point-to-point motion with steps of acceleration and pauses at rest: time, position and current."""
    rng, cycle_s = np.random.default_rng(2), 0.01
    states, here = [], np.zeros(6)
    for _ in range(16):
        way, half = rng.uniform(-0.6, 0.6, 6) - here, int(rng.integers(50, 80))
        push = way / (half * cycle_s) ** 2
        elapsed = np.arange(1, 2 * half + 1)[:, None] * cycle_s
        second = np.where(elapsed <= half * cycle_s, push, -push)
        first = np.cumsum(second, axis=0) * cycle_s
        states.append((here + np.cumsum(first, axis=0) * cycle_s, first, second))
        still = np.zeros((15, 6))
        states.append((states[-1][0][-1] + still, still, still))
        here = states[-1][0][-1]
    q, dq, ddq = (np.vstack(part) for part in zip(*states, strict=True))
    torque = pinocchio_arm.torque(q, dq, ddq, pinocchio_arm.payload)
    noisy = torque + pinocchio_arm.noise_nm * rng.normal(size=q.shape)
    current = noisy @ pinocchio_arm.transmission.coupling / pinocchio_arm.transmission.gain_nm_a
    return np.arange(len(q)) * cycle_s, q + 2e-5 * rng.normal(size=q.shape), np.ascontiguousarray(current)
