"""Tilt of an arm's base: gravity that is not where the robot's file has it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from armload_identification.estimation.estimation_constants import Rows
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain


def tilt_axes(gravity_m_s2: FloatArray) -> FloatArray:
    """Two directions perpendicular to gravity, in which it tilts if the base is not level.

    Args:
        gravity_m_s2: (3,) gravity in the base frame.

    Returns:
        (2, 3) orthogonal unit vectors.
    """
    down = gravity_m_s2 / np.sqrt(np.sum(gravity_m_s2**2))
    other = np.eye(3)[0] if abs(down[0]) < Rows.tilted else np.eye(3)[1]
    first = np.cross(down, other)
    first /= np.sqrt(np.sum(first**2))
    return np.stack([first, np.cross(down, first)])


@lru_cache(maxsize=8)
def sideways(chain: Chain) -> tuple[Chain, ...]:
    """The arm with gravity along each tilt axis only: the effect of one rad of tilt."""
    size = float(np.sqrt(np.sum(chain.gravity_m_s2**2)))
    return tuple(chain.under(size * axis) for axis in tilt_axes(chain.gravity_m_s2))
