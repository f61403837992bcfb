"""Limited-memory BFGS, for the excitation's inner problems.

SciPy's solver is not used here: its linear algebra wakes BLAS threads for matrices of ten rows, which costs
three times the time on a busy machine, and lets the result depend on the number of threads. This one is
vector products only: the same start gives the same end.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_MEMORY = 20
_DECREASE = 1e-4
_CURVATURE = 0.9
_LINE_STEPS = 20
_SMALLEST_GAIN = 1e-9


def minimise(
    function: Callable[[FloatArray], tuple[float, FloatArray]], start: FloatArray, iterations: int
) -> FloatArray:
    """A local minimum of a function, found by its gradient.

    Args:
        function: Gives value and gradient (n,); the value may be inf where the function does not exist.
        start: (n,) where to begin; the value must be finite there.
        iterations: At most this many line searches.

    Returns:
        (n,) the best point found; never worse than the start.

    References:
        Nocedal, Wright, Numerical Optimization, 2nd ed. 2006, algorithm 7.4. The line search bisects for the weak
        Wolfe conditions: Lewis, Overton, Nonsmooth optimization via quasi-Newton methods, Math. Programming 141, 2013.
    """
    x = start
    value, gradient = function(x)
    pairs: deque[tuple[FloatArray, FloatArray, float]] = deque(maxlen=_MEMORY)
    for _ in range(iterations):
        direction = -_inverse_hessian_times(gradient, pairs)
        slope = float(gradient @ direction)
        if not slope < 0.0:
            break
        first = 1.0 if pairs else min(1.0, 1.0 / float(np.sqrt(gradient @ gradient)))
        found = _line_search(function, x, value, direction, slope, first)
        if found is None:
            break
        next_x, next_value, next_gradient = found
        step, change = next_x - x, next_gradient - gradient
        curvature = float(step @ change)
        if curvature > 0.0:
            pairs.append((step, change, 1.0 / curvature))
        gain = value - next_value
        x, value, gradient = next_x, next_value, next_gradient
        if gain < _SMALLEST_GAIN * (1.0 + abs(value)):
            break
    return x


def _inverse_hessian_times(vector: FloatArray, pairs: deque[tuple[FloatArray, FloatArray, float]]) -> FloatArray:
    """The two-loop recursion."""
    result = vector.copy()
    shares = []
    for step, change, inverse in reversed(pairs):
        share = inverse * float(step @ result)
        result -= share * change
        shares.append(share)
    if pairs:
        step, change, inverse = pairs[-1]
        result *= 1.0 / (inverse * float(change @ change))
    for (step, change, inverse), share in zip(pairs, reversed(shares), strict=True):
        result += (share - inverse * float(change @ result)) * step
    return result


def _line_search(
    function: Callable[[FloatArray], tuple[float, FloatArray]],
    x: FloatArray,
    value: float,
    direction: FloatArray,
    slope: float,
    first: float,
) -> tuple[FloatArray, float, FloatArray] | None:
    """A step that decreases enough and flattens the slope; the best decrease there was, or None without any."""
    low, high, length = 0.0, np.inf, first
    best: tuple[FloatArray, float, FloatArray] | None = None
    for _ in range(_LINE_STEPS):
        candidate = x + length * direction
        trial, gradient = function(candidate)
        if not trial <= value + _DECREASE * length * slope:
            high = length
        else:
            if best is None or trial < best[1]:
                best = (candidate, trial, gradient)
            if float(gradient @ direction) >= _CURVATURE * slope:
                break
            low = length
        length = 2.0 * low if high == np.inf else 0.5 * (low + high)
    return best
