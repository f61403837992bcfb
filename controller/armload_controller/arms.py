"""Opening an arm: the simulated one in this process, or drives on a bus.

Until driver and motion layer are complete, a bus other than `virtual` is only driven when the caller asks for
simulated drives and every node shows the simulation's identity; anything else is refused before a frame
that could move or configure something is sent.
"""

from __future__ import annotations

VIRTUAL = "virtual"
