"""Tables 2 and 3 of Chen 2016, with the paper's sign of the products of inertia.

References:
    Chen et al., Journal of Nanjing University of Aeronautics & Astronautics 48(6), 2016, 835-840.
"""

from __future__ import annotations

from typing import Final

import numpy as np

NAMES: Final = ("m", "c_x", "c_y", "c_z", "I_xx", "I_yy", "I_zz", "I_xy", "I_xz", "I_yz")
UNITS: Final = ("kg", "m", "m", "m", *("kg m2",) * 6)
ESTIMATE: Final = np.array([9.323, 0.149, 1.081, -0.125, 7.917, 0.420, 8.281, 1.068, -0.158, -1.105])
ERROR_PERCENT: Final = np.array([5.0, 14.6, 15.0, 22.5, 12.3, 19.0, 8.1, 12.6, 18.8, 14.3])
RESIDUAL_NM: Final = np.array([18.552, 23.176, 15.951])
"""RMS1 of joints 1 to 3: residual of the fit."""
NOISE_NM: Final = np.array([16.851, 14.230, 13.247])
"""RMS2: noise of one raw sample at 100 Hz."""
