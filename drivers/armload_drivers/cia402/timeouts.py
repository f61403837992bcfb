"""Every wait of the CANopen master, in one place."""

from __future__ import annotations

from typing import Final

from msgspec import Struct

FEEDBACK_SHARE: Final = 0.6
"""Share of the cycle in which the drives' feedback is waited for; the rest is left to the caller."""


class Timeouts(Struct, frozen=True):
    """Limits of all waits. Errors name the wait that timed out.

    How long bring-up listens for another master follows from the heartbeat: `canopen.safe_reset`.

    Attributes:
        probe_s: First query of a node by one SDO, before it is reset.
        scan_s: For answers of nodes that are not configured, all queried at once.
        boot_s: From the NMT reset of a node to its boot-up message; after that it is queried by SDO.
        sdo_s: One SDO request to its answer.
        mode_s: From writing 6060 to 6061 reporting the same.
        enable_s: From the first cycle to OPERATION ENABLED of every drive, brakes included; time of the SYNC.
        stop_s: From the quick stop to standstill; time of the SYNC.
        disable_s: From standstill to drives without torque; time of the SYNC.
        torque_off_s: One SDO request to its answer while an axis is in motion that has lost its loop.
        store_s: From the request to store settings to its confirmation.
        fault_reset_s: From the first rising edge to SWITCH ON DISABLED.
    """

    probe_s: float = 0.2
    scan_s: float = 0.2
    boot_s: float = 5.0
    sdo_s: float = 0.5
    mode_s: float = 1.0
    enable_s: float = 3.0
    stop_s: float = 5.0
    disable_s: float = 3.0
    torque_off_s: float = 0.05
    store_s: float = 10.0
    fault_reset_s: float = 2.0


USUAL: Final = Timeouts()
"""The limits of a real arm; tests have shorter ones."""
