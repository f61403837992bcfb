"""Time of an update of the recursive estimator, by the number of joints.

An update does the same work whenever it processes the same samples, so that each is timed in several rounds and its
least time is used: longer times are due to other load. It takes longest after a change of the payload. From Python the
time includes the call; in C it is the mean over a stream.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from armload_core import kernels
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain

JOINTS = (3, 4, 6, 7, 10, 16)
LASTS_S, SAMPLE_S = 20.0, 0.004
ROUNDS = 9
Stream = tuple[FloatArray, FloatArray, FloatArray]


class Updating(Protocol):
    """An estimator, or its kernel."""

    def update(self, time_s: float, position: FloatArray, effort: FloatArray, /) -> None:
        """Process a sample."""


def least_times_us(make: Callable[[], Updating], stream: Stream) -> FloatArray:
    """Least time in us of every update of a stream, minus the clock's own.

    Args:
        make: Makes a new estimator.
        stream: Time (K,), positions and efforts (K, n).
    """
    rows = list(zip(stream[0].tolist(), stream[1], stream[2], strict=True))
    least, clock = np.full(len(rows), np.inf), time.perf_counter_ns
    idle = min(-clock() + clock() for _ in range(1000))
    for _ in range(ROUNDS):
        update = make().update
        for k, (time_s, position, effort) in enumerate(rows):
            begin = clock()
            update(time_s, position, effort)
            least[k] = min(least[k], clock() - begin - idle)
    return least * 1e-3


def _estimator(n: int) -> kernels.PayloadEstimator:
    """The kernel for an arm of n equal joints, alternately about z and x."""
    placement = np.tile(np.eye(4), (n, 1, 1))
    placement[:, 2, 3] = 0.2
    axis = np.tile(np.eye(3)[[2, 0]], (n, 1))[:n]
    chain = Chain(placement, axis, np.eye(4), np.array([0.0, 0.0, -9.81]))
    parameter = np.full((kernels.ESTIMATOR_PARAMETERS, n), 0.05)
    parameter[kernels.ESTIMATOR_NOISE] = parameter[kernels.ESTIMATOR_COLOUR] = 1.0
    links, scale = np.full((n, 10), 0.1), np.array([10.0] + [3.0] * 3 + [0.9] * 6)
    return kernels.PayloadEstimator(chain.packed, links, np.eye(n), np.eye(n), parameter, scale, 60.0, 1e-3)


def _stream(n: int) -> Stream:
    """All joints in motion, and a load from halfway on."""
    time_s = np.arange(0.0, LASTS_S, SAMPLE_S)
    position = np.sin(np.outer(time_s, 1.0 + 0.3 * np.arange(n)) + np.arange(n))
    effort = np.random.default_rng(1).normal(size=position.shape) + 50.0 * (time_s[:, None] > 0.5 * LASTS_S)
    return time_s, position, effort


def run() -> None:
    """Print the table."""
    print(f"\nAn update of the recursive estimator at {1.0 / SAMPLE_S:g} Hz, us; the least of {ROUNDS} rounds")
    print("  joints | in C, mean | from Python: median, with a row (median), 99.9 %, greatest")
    for n in JOINTS:
        stream = _stream(n)
        took = least_times_us(lambda n=n: _estimator(n), stream)  # type: ignore[misc]
        begin_s = time.process_time()
        for _ in range(ROUNDS):
            _estimator(n).update_all(*stream)
        mean_us = 1e6 * (time.process_time() - begin_s) / (ROUNDS * len(took))
        with_row = np.median(took[took > 0.5 * np.quantile(took, 0.999)])
        median, most, worst = np.quantile(took, [0.5, 0.999, 1.0])
        print(f"  {n:6d} | {mean_us:10.2f} | {median:5.2f} {with_row:6.2f} {most:6.2f} {worst:6.2f}")


if __name__ == "__main__":
    run()
