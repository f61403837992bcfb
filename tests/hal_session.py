"""Runs inside `halrun`, with the system's Python, which has LinuxCNC's module `hal`: sets pins and waits for others.

    hal_session.py STEPS.json RESULTS.json [PIN ...]

A step sets pins, waits until other pins have given values, and records the changes of the watched pins meanwhile. The
pins on the command line are created here, as inputs of a component in place of the fieldbus.
"""

import json
import sys
import time
from pathlib import Path

import hal

LONGEST_S = 20.0


def reached(step):
    """Whether every pin has its value."""
    tolerance = step.get("tolerance", 0.0)
    return all(abs(hal.get_value(pin) - value) <= tolerance for pin, value in step["until"].items())


def carry_out(step):
    """One step; the values of the watched pins during it, and of the awaited pins at its end."""
    for pin, value in step.get("set", {}).items():
        hal.set_p(pin, repr(value))
    watched = step.get("watch", [])
    seen = {pin: [] for pin in watched}
    ends_s = time.monotonic() + LONGEST_S
    while not reached(step) and time.monotonic() < ends_s:
        for pin in watched:
            value = hal.get_value(pin)
            if not seen[pin] or seen[pin][-1] != value:
                seen[pin].append(value)
        time.sleep(2e-4)
    return {"found": {pin: hal.get_value(pin) for pin in step["until"]}, "seen": seen}


def main():
    """Carry out all steps."""
    steps, results, *pins = sys.argv[1:]
    component = hal.component("lcec" if pins else "hal_session")
    for pin in pins:
        component.newpin(pin.removeprefix("lcec."), hal.HAL_FLOAT, hal.HAL_IN)
    component.ready()
    done = [carry_out(step) for step in json.loads(Path(steps).read_text())]
    Path(results).write_text(json.dumps(done))


main()
