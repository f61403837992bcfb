"""The array type of all equations."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
"""An array of float64 of any shape; shape and units are in the docstring of the function that takes or returns it."""
