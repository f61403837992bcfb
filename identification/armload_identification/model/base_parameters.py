"""Which parameters of an arm's links and rotors are identifiable from its motion: the base parameters.

References:
    Gautier, Numerical calculation of the base inertial parameters of robots, Journal of Robotic Systems 8(4), 1991.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import PARAMETERS, body_regressor, rotor_columns

_STATES: Final = 200
_SEED: Final = 20160606
_BASE_TOLERANCE: Final = 1e-8
_ALIKE: Final = 1.0 - 1e-6


def base_columns(chain: Chain, coupling: FloatArray) -> NDArray[np.bool_]:
    """Which parameters of links and rotors are identifiable from an arm's motion.

    Args:
        coupling: (n, n) C of its motors.

    Returns:
        (11 n,) True for the base parameters: ten per link, then the rotors. If a rotor's inertia cannot be separated
        from its link's, the link's represents both.
    """
    n = chain.n
    q, dq, ddq = np.random.default_rng(_SEED).uniform(-np.pi, np.pi, (3, _STATES, n))
    links = body_regressor(chain, q, dq, ddq).reshape(-1, PARAMETERS * n)
    rotors = rotor_columns(ddq, coupling).transpose(0, 2, 1).reshape(-1, n)
    base = np.zeros((PARAMETERS + 1) * n, dtype=bool)
    base[_independent(links)] = True
    # Rotors come second: what a link's parameters can represent stays with the link.
    orthogonal, _ = np.linalg.qr(links[:, base[: PARAMETERS * n]])
    left = rotors - orthogonal @ (orthogonal.T @ rotors)
    identifiable = _independent(left / np.sqrt(np.sum(rotors**2, axis=0)), unit=False)
    base[PARAMETERS * n + identifiable] = True
    return base


def _independent(columns: FloatArray, *, unit: bool = True) -> NDArray[np.intp]:
    """Indices of a maximal well-conditioned set of independent columns."""
    length = np.sqrt(np.sum(columns**2, axis=0)) if unit else np.ones(columns.shape[1])
    left = columns / np.where(length > 0.0, length, 1.0)
    # As by a QR factorisation with pivots: the most independent column, of equal ones the first, whatever the rounding.
    chosen: list[int] = []
    while len(chosen) < len(length):
        rest = np.sqrt(np.sum(left**2, axis=0))
        best = int(np.argmax(rest > _ALIKE * rest.max()))
        if rest[best] <= _BASE_TOLERANCE:
            break
        chosen.append(best)
        left -= np.outer(left[:, best] / rest[best], left[:, best] / rest[best] @ left)
    return np.array(chosen, dtype=np.intp)
