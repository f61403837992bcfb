"""What went wrong on the bus without stopping the arm, in words for the operator.

Error frames, a full transmit queue and frames of a wrong length are survived, so nothing else mentions them; but they
announce a failure, and are found in the cable, its termination or a second node with the same id.
"""

from __future__ import annotations

from collections.abc import Sequence

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.cyclic.rhythm import Rhythm


class BusRemarks:
    """Remarks on one bus.

    Args:
        nodes: The drives of the arm.
        rhythms: What should recur every cycle.
    """

    def __init__(self, link: BusLink, nodes: Sequence[DriveNode], rhythms: Sequence[Rhythm]) -> None:
        self._link, self._nodes, self._rhythms = link, nodes, rhythms
        self._reported = self._counts()

    def take(self) -> tuple[str, ...]:
        """Lines about what was counted since the last call; empty if there was nothing."""
        before, self._reported = self._reported, self._counts()
        frames, passive, full, *wrong = (now - then for now, then in zip(self._reported, before, strict=True))
        found = [
            text
            for count, text in (
                (frames, _counted(frames, "error frame")),
                (passive, f"the controller was error passive {_counted(passive, 'time')}"),
                (full, f"the transmit queue was full {_counted(full, 'time')}"),
                *(
                    (count, f"{_counted(count, 'frame')} of {node.settings.joint} had a wrong length")
                    for node, count in zip(self._nodes, wrong, strict=True)
                ),
            )
            if count
        ]
        lines = []
        if found:
            lines.append(
                f"warning: bus: {', '.join(found)}. Check cable, termination, bit rate, node ids and txqueuelen"
            )
        irregular = [text for rhythm in self._rhythms if (text := rhythm.take())]
        if irregular:
            lines.append(f"warning: {'; '.join(irregular)}. Check the computer's load, the bus load and priorities")
        skew = self._link.take_skew()
        return (*lines, skew) if skew else tuple(lines)

    def _counts(self) -> list[int]:
        """All counts so far."""
        link = self._link
        return [link.error_frames, link.times_passive, link.queue_full, *(node.wrong_frames for node in self._nodes)]


def _counted(number: int, what: str) -> str:
    """A number of things."""
    return f"{number} {what}{'' if number == 1 else 's'}"
