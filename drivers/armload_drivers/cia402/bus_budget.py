"""Worst-case bus load of a configuration, computed before anything is sent.

A classical CAN frame with an 11-bit identifier and n data bytes has at most

    47 + 8 n + floor((34 + 8 n - 1) / 4)

bits: the fields, the interframe space of 3 bits, and a stuff bit after every fourth bit of the 34 + 8 n that
can be stuffed.

References:
    Davis et al. 2007, "Controller Area Network (CAN) schedulability analysis", eq. (2).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from msgspec import Struct

from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_drivers.driver_errors import BusOverload

MAX_BUS_LOAD: Final = 0.7
"""Greatest permitted worst-case load, as a share of the bus."""
USUAL_RATES_HZ: Final = (1000, 500, 250, 200, 125, 100, 50, 40, 25, 20, 10)
"""Rates whose cycle is a whole number of milliseconds, as many drives require (60C2)."""

READ_AGAIN_S: Final = 1.9
"""Time in which every setting of every drive is read again in motion; 2 s are required."""
SETTINGS: Final = 22
"""Greatest number of settings of a drive that are read again and are not manufacturer-specific."""


def frame_bits(data_bytes: int) -> int:
    """Worst-case number of bits of one frame, including stuff bits and interframe space."""
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


FRAME_BITS: Final = tuple(frame_bits(min(length, 8)) for length in range(65))
"""`frame_bits` by length; a node of another kind may send CAN FD frames."""


class BusLoad(Struct, frozen=True):
    """Worst-case bus load of a configuration.

    Attributes:
        cycle_share: Bus time of the frames of one cycle (SYNC and all PDOs) as a share of the cycle.
        heartbeat_share: Share of the heartbeats of master and drives.
        settings_share: Share of reading the drives' settings again.
        cycle_hz: The highest usual rate within the limit; 0 if there is none.
    """

    cycle_share: float
    heartbeat_share: float
    settings_share: float
    cycle_hz: int

    @property
    def share(self) -> float:
        """Total share of the bus."""
        return self.cycle_share + self.heartbeat_share + self.settings_share

    @property
    def fits(self) -> bool:
        """Whether the share stays within the limit."""
        return self.share <= MAX_BUS_LOAD


def forecast(arm: ArmSettings) -> BusLoad:
    """Worst-case load of a configured arm, on its busiest bus.

    Other SDO and EMCY are not counted: the limit leaves room for them.
    """
    return max(map(_forecast, arm.by_bus()), key=lambda load: load.share)


def _forecast(arm: ArmSettings) -> BusLoad:
    """Worst-case load of the drives of one bus."""
    images = [drive_image(drive) for drive in arm.drives]
    sync_bits = frame_bits(1 if arm.sync_counter else 0)
    bits = sync_bits + sum(frame_bits(layout.length) for image in images for layout in image.layouts)
    cycle_bus_s = bits / arm.bitrate
    heartbeats_s = (len(images) + 1) * frame_bits(1) / arm.bitrate
    heartbeat_share = heartbeats_s / arm.heartbeat_s
    settings = sum(SETTINGS + len(drive.vendor_settings) for drive in arm.drives)
    settings_share = settings * 2 * frame_bits(8) / arm.bitrate / READ_AGAIN_S
    room = max(0.0, MAX_BUS_LOAD - heartbeat_share - settings_share)
    return BusLoad(
        cycle_share=cycle_bus_s / arm.cycle_s,
        heartbeat_share=heartbeat_share,
        settings_share=settings_share,
        cycle_hz=next((rate for rate in USUAL_RATES_HZ if rate * cycle_bus_s <= room), 0),
    )


def require_room(arm: ArmSettings) -> BusLoad:
    """The forecast, after checking that the bus can carry it.

    Raises:
        BusOverload: naming the load, the limit and the highest rate that fits.
    """
    load = forecast(arm)
    if load.fits:
        return load
    if load.cycle_hz:
        remedy = f"at {arm.bitrate} bit/s this fits: cycle_hz = {load.cycle_hz}"
    else:
        remedy = f"no cycle rate fits at {arm.bitrate} bit/s; raise the bit rate"
    if not any(drive.bus for drive in arm.drives):
        remedy += ". Or put some of the joints on a second bus ([bus.a], [bus.b])"
    counts = [len(part.drives) for part in arm.by_bus()]
    drives = f"{' + '.join(map(str, counts))} drives{' on two buses' if len(counts) > 1 else ''}"
    raise BusOverload(
        f"{drives} at {1 / arm.cycle_s:.0f} Hz load the bus by up to {100.0 * load.share:.0f} %, the "
        f"limit is {100.0 * MAX_BUS_LOAD:.0f} %: {remedy}"
    )


def with_rate_for(arm: ArmSettings, **of_drives: Any) -> str:
    """What advice about every drive must add so that it fits the bus, as text; empty if it fits, or fits no PDO.

    Args:
        of_drives: Fields of `DriveSettings` as the advice would set them.
    """
    try:
        load = forecast(replace(arm, drives=tuple(replace(drive, **of_drives) for drive in arm.drives)))
    except ValueError:  # fixed PDOs with other sizes
        return ""
    if load.fits or not load.cycle_hz:
        return ""
    return f", together with cycle_hz = {load.cycle_hz}, since the bus carries no more of these PDOs"
