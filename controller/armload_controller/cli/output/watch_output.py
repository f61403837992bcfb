"""A moment of a watched arm as a line."""

from __future__ import annotations

import numpy as np

from armload_controller.analysis.payload_watch import WatchedMoment

_SLOW_S = 3.0


def moment_text(moment: WatchedMoment) -> str:
    """Time, mass with its interval, and centre of mass; or that the motion shows nothing yet."""
    found = moment.payload
    at = f"{found.time_s:10.1f} s  "
    if found.moving_s.max() < _SLOW_S:
        return f"{at}nothing to be seen yet: the joints have moved for {found.moving_s.max():.1f} s at most"
    mass = f"{found.mass_kg:7.3f} +- {found.half_width_95[0]:.3f} kg"
    if not found.determined[1:].any():
        return at + mass
    center = zip(1e3 * found.values[1:], 1e3 * np.asarray(found.half_width_95[1:]), found.determined[1:], strict=True)
    return f"{at}{mass}  centre {', '.join(f'{c:.0f} +- {w:.0f}' if sure else '?' for c, w, sure in center)} mm"
