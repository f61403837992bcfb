"""A watched arm on the console: lines in a file or pipe, one table that is redrawn on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from armload_controller.analysis.payload_watch import SHOWN_S, SILENT_S, HeardBus, WatchedMoment, drift_note
from armload_identification.contact.force_watch import Force
from armload_identification.result_table import ResultTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from armload_controller.cli.screen import Screen

_FULL_BAR_S = 20.0
"""Time in motion at which a bar is full."""
_BAR_CHARACTERS = 20


@contextmanager
def shown_moments(screen: Screen, robot: str, joint_names: Sequence[str]) -> Iterator[Callable[[WatchedMoment], None]]:
    """Show moments as they come; if they are printed as documents, only their events.

    Yields:
        A function to call with each moment.
    """
    noted = set()

    def events(moment: WatchedMoment) -> None:
        for event in moment.events:
            screen.step(f"{event.time_s:10.1f} s  {event}")
        note = drift_note(moment)
        if note is not None and moment.payload is not None and moment.payload.changes not in noted:
            noted.add(moment.payload.changes)
            screen.step(note)

    if screen.as_json or not screen.console.is_terminal:

        def line(moment: WatchedMoment) -> None:
            events(moment)
            screen.result(moment_text(moment))

        yield line
        return
    from rich.live import Live

    from armload_controller.cli.console_text import drawn

    with Live(console=screen.console, auto_refresh=False) as live:

        def draw(moment: WatchedMoment) -> None:
            events(moment)
            live.update(drawn(moment_table(moment, robot, joint_names)), refresh=True)

        yield draw


def moment_table(moment: WatchedMoment, robot: str, joint_names: Sequence[str]) -> ResultTable:
    """A moment as a table: the line of `moment_text`, and the time in motion of each joint."""
    found, bus = moment.payload, moment.bus
    moving_s = np.zeros(len(joint_names)) if found is None else found.moving_s
    lost_frames = (0,) * len(joint_names) if bus is None else bus.missing
    rows = []
    for name, moved_s, lost in zip(joint_names, moving_s.tolist(), lost_frames, strict=True):
        bar = "#" * round(_BAR_CHARACTERS * min(moved_s / _FULL_BAR_S, 1.0))
        rows.append((name, f"{moved_s:.1f}", bar.ljust(_BAR_CHARACTERS, "."), str(lost)))
    headings = ("joint", "moved s", "", "feedback frames missing")
    return ResultTable(f"{robot}: {moment_text(moment).strip()}", headings, rows, (0, 2))


def moment_text(moment: WatchedMoment) -> str:
    """Time, mass with its interval, and centre of mass; or why there is no estimate."""
    found, bus = moment.payload, moment.bus
    at = " " * 14 if moment.time_s is None else f"{moment.time_s:10.1f} s  "
    if bus is not None and not bus.cycles:
        return f"{at}nothing received from the arm yet"
    if bus is not None and bus.silent_s > SILENT_S:
        return f"{at}nothing has been received for {bus.silent_s:.0f} s"
    lost = "" if bus is None else _lost(bus)
    if bus is not None and not bus.enabled:
        return f"{at}the drives are not enabled{lost}"
    if found is None:
        return f"{at}{0 if bus is None else bus.cycles} cycles{lost}"
    if found.moving_s.max() < SHOWN_S:
        return f"{at}no estimate yet: {found.moving_s.max():.1f} s of motion of {SHOWN_S:g} s needed{lost}"
    mass = f"{found.mass_kg:z7.3f} +- {found.half_width_95[0]:.3f} kg"
    if moment.force is not Force.FREE:
        return f"{at}{mass}, held: {moment.force}{lost}"
    if not found.determined[1:].any():
        return at + mass + lost
    center = zip(1e3 * found.values[1:], 1e3 * np.asarray(found.half_width_95[1:]), found.determined[1:], strict=True)
    return f"{at}{mass}  centre {', '.join(f'{c:z.0f} +- {w:.0f}' if sure else '?' for c, w, sure in center)} mm{lost}"


def _lost(bus: HeardBus) -> str:
    """What was not received, and what the controller was told, if anything."""
    parts = [f"{sum(bus.missing)} feedback frames missing"] if any(bus.missing) else []
    parts += [f"{bus.lost} of {bus.cycles + bus.lost} cycles lost"] if bus.lost else []
    parts += [] if bus.told is None else [f"the controller was told {bus.told.mass_kg:.3f} kg"]
    return "".join(f"  {part}" for part in parts)
