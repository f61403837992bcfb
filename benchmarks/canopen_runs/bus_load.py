"""Load of the bus, computed before anything is sent and measured: 6 and 12 axes at 100, 250 and 500 Hz, with 60B2.

Computed: `bus_budget.forecast`, every frame at its worst-case length. Measured: all frames of ten seconds of motion
on a lockstep bus with simulated drives, with the stuff bits that their content has; SDO of the settings that are read
again included. An arm that does not fit one bus is measured on two, and its busier bus counts.

    python -m benchmarks.canopen_runs.bus_load
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace

import can
import numpy as np

from armload_controller.config.robot import load_robot
from armload_drivers.bus.joined_bus import BusRole
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.bus_budget import MAX_BUS_LOAD, forecast, require_room
from armload_drivers.driver_errors import BusOverload
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, lockstep_bus, lockstep_wires
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock
from tests.ideal_plant import IdealPlant

AXES, RATES_HZ, LASTS_S = (6, 12), (100, 250, 500), 10.0
_CRC = 0x4599
"""Generator of CAN's cyclic redundancy check: ISO 11898-1."""
_AFTER_CRC = 13
"""CRC delimiter, acknowledgement with its delimiter, end of frame, interframe space."""


def bits_on_the_wire(identifier: int, data: bytes) -> int:
    """Bits of a data frame with an 11-bit identifier, with the stuff bits that its content has."""
    text = f"0{identifier:011b}000{len(data):04b}" + "".join(f"{byte:08b}" for byte in data)
    check = 0
    for bit in text:
        check = (check << 1) ^ (_CRC if (check >> 14 & 1) != int(bit) else 0)
        check &= 0x7FFF
    text += f"{check:015b}"
    stuffed, run, last = 0, 0, ""
    for bit in text:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, "1" if bit == "0" else "0"
    return len(text) + stuffed + _AFTER_CRC


def run() -> None:
    """Print the table."""
    print(f"Load of a bus of 1 Mbit/s with 60B2; at most {100 * MAX_BUS_LOAD:.0f} % computed. On two buses: the busier")
    print("  axes   Hz  buses   computed  measured")
    for axes in AXES:
        for rate_hz in RATES_HZ:
            one = _arm(axes, rate_hz)
            halves = tuple(replace(drive, bus=int(k >= axes // 2)) for k, drive in enumerate(one.drives))
            for arm in (one, replace(one, drives=halves)):
                try:
                    require_room(arm)
                except BusOverload:
                    fits, measured = False, "refused"
                else:
                    fits, measured = True, f"{100 * _measured(arm):5.1f} %"
                computed = 100 * forecast(arm).share
                print(
                    f"  {axes:4d}  {rate_hz:3d}      {len(arm.by_bus())}     {computed:5.1f} %    {measured}",
                    flush=True,
                )
                if fits:
                    break


def _arm(axes: int, rate_hz: int) -> ArmSettings:
    """er50's drives, as often as needed."""
    arm = load_robot("er50").drives.settings
    drives = tuple(replace(arm.drives[k % len(arm.drives)], joint=f"joint_{k + 1}", node_id=k + 1) for k in range(axes))
    return replace(arm, drives=drives, cycle_s=1.0 / rate_hz, coupling=np.eye(axes))


def _measured(arm: ArmSettings) -> float:
    """Load of the busiest bus in motion, with true stuff bits."""
    n, clock, wires = len(arm.drives), VirtualClock(), lockstep_wires(arm)
    bits = [0] * len(wires)
    with ExitStack() as stack:
        drives_bus = stack.enter_context(lockstep_bus(arm, wires, BusRole.DRIVES))
        bus = stack.enter_context(lockstep_bus(arm, wires, BusRole.MASTER))
        for number, wire in enumerate(wires):

            def count(message: can.Message, number: int = number) -> None:
                bits[number] += bits_on_the_wire(message.arbitration_id, bytes(message.data))

            stack.enter_context(LockstepBus(wire)).listen(count)
        stack.enter_context(SimulatedDrives(arm, IdealPlant(np.zeros(n)), drives_bus, clock))
        servos = CanopenServos(arm, bus, LockstepSync(clock))
        servos.connect()
        start_rad, zero = servos.enable().position_rad, np.zeros(n)
        before, began_s = list(bits), clock()
        for cycle in range(round(LASTS_S / arm.cycle_s)):
            moved_rad = 0.05 * (1.0 - np.cos(cycle * arm.cycle_s))
            feedback = servos.exchange(JointCommand(start_rad + moved_rad, zero, zero + 3.0 * np.sin(cycle)))
        lasted_s = feedback.time_s - began_s
        load = max(now - then for now, then in zip(bits, before, strict=True)) / (lasted_s * arm.bitrate)
        servos.close()
    return load


if __name__ == "__main__":
    run()
