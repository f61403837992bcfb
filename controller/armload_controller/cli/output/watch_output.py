"""A moment of a watched arm as a line."""

from __future__ import annotations

import numpy as np

from armload_controller.analysis.payload_watch import WatchedMoment

_SLOW_S = 3.0


def moment_text(moment: WatchedMoment) -> str:
    """Time, mass with its interval, and centre of mass; or why there is nothing to be seen."""
    found, bus = moment.payload, moment.bus
    at = f"{moment.time_s:10.1f} s  "
    if bus is not None and bus.silent_s > _SLOW_S:
        return f"{at}the bus has been silent for {bus.silent_s:.0f} s"
    lost = "" if bus is None or not any(bus.missing) else f"  {sum(bus.missing)} answers missing"
    if bus is not None and not bus.enabled:
        return f"{at}the drives are not enabled{lost}"
    if found is None:
        return f"{at}{0 if bus is None else bus.cycles} cycles{lost}"
    if found.moving_s.max() < _SLOW_S:
        return f"{at}nothing to be seen yet: the joints have moved for {found.moving_s.max():.1f} s at most{lost}"
    mass = f"{found.mass_kg:7.3f} +- {found.half_width_95[0]:.3f} kg"
    if not found.determined[1:].any():
        return at + mass + lost
    center = zip(1e3 * found.values[1:], 1e3 * np.asarray(found.half_width_95[1:]), found.determined[1:], strict=True)
    return f"{at}{mass}  centre {', '.join(f'{c:.0f} +- {w:.0f}' if sure else '?' for c, w, sure in center)} mm{lost}"
