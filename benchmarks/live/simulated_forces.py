"""Load or push on simulated arms: false events in an hour of empty motion and in cold starts, and contacts in MuJoCo.

    python -m benchmarks.live.simulated_forces

The hour and the beginnings are those of `benchmarks.accuracy.simulated_motion`: friction that settles, or differs by a
fifth. A contact is a force of a second on the last link, in MuJoCo itself: the servo loops react to it.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Final

import numpy as np

from armload_controller.config.robot import load_robot
from armload_core.arrays import FloatArray
from armload_identification.contact.force_watch import ForceEventKind
from armload_identification.contact.watched_payload import WatchedPayload
from benchmarks.accuracy.simulated_motion import (
    COLD,
    Signals,
    an_hour,
    beginnings,
    calibration_of,
    scales_of,
    signals_of,
)
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.streamed_arm import streamed
from benchmarks.arms.streams import as_recorded, point_to_point
from benchmarks.live.pushes import Outcome, outcome

ARM: Final = "prbt"
FIRST_S, APART_S, LASTS_S = 15.0, 9.0, 1.0
"""Time of the first push, between two, and of one."""
PUSHES: Final = 8
"""Pushes in one motion."""
SWING_RAD, SWING_S = 0.5, 5.0
"""Amplitude and period of a joint that moves alone."""


def false_events(watch: WatchedPayload, motions: Iterable[Signals]) -> int:
    """Number of notices in motions without a force."""
    for motion in motions:
        watch.take(*motion)
    return sum(event.kind is ForceEventKind.ACTING for event in watch.take_events())


def contacts(size_n: float, alone: int | None, seed: int) -> list[Outcome]:
    """Pushes against the empty arm in random motion, or while one joint moves alone after it."""
    robot, rng = load_robot(ARM), np.random.default_rng([seed, int(size_n)])
    calibration = calibration_of(robot, Twin.NORMATIVE, rng, np.zeros(robot.n))
    rate_hz = robot.bus.cycle_hz
    lasts_s = FIRST_S + PUSHES * APART_S
    setpoints = point_to_point(robot, 300 + seed, lasts_s if alone is None else FIRST_S)
    if alone is not None:
        swing_s = np.arange(round(PUSHES * APART_S * rate_hz)) / rate_hz
        more = np.tile(setpoints[-1], (swing_s.size, 1))
        more[:, alone] += SWING_RAD * np.sin(2.0 * np.pi * swing_s / SWING_S) * np.minimum(swing_s, 1.0)
        setpoints = np.vstack([setpoints, more])
    time_s = np.arange(len(setpoints)) / rate_hz
    force, begun = np.zeros((len(setpoints), 3)), []
    for number in range(PUSHES):
        at_s = FIRST_S + number * APART_S + float(rng.uniform(2.0, 4.0))
        if alone is not None:
            # near the middle of a swing, where the joint moves
            at_s = FIRST_S + SWING_S * round(2.0 * (at_s - FIRST_S) / SWING_S) / 2.0 - 0.3
        begun.append(at_s)
        force[(time_s >= at_s) & (time_s < at_s + LASTS_S)] = size_n * _direction(rng)
    moved = streamed(twin_spec(robot, Twin.NORMATIVE, None), robot.drives.settings, setpoints, force)
    signals = signals_of(as_recorded(moved, scales_of(robot), rng, np.zeros(robot.n), "pushed"))
    watch = WatchedPayload(calibration, robot.chain, robot.drives.transmission)
    watch.take(*signals)
    events = watch.take_events()
    return [outcome([each for each in events if each.time_s < at_s + APART_S - 2.0], at_s) for at_s in begun]


def _direction(rng: np.random.Generator) -> FloatArray:
    """(3,) random unit vector that is not vertical."""
    while True:
        vector = rng.normal(size=3)
        vector /= np.linalg.norm(vector)
        if abs(vector[2]) < 0.65:
            return np.asarray(vector)


def main() -> None:
    """Print the figures beside what is asked for."""
    for name, cold in product(("er50", "prbt"), (COLD, -COLD)):
        robot, calibration, motions = an_hour(name, cold)
        count = false_events(WatchedPayload(calibration, robot.chain, robot.drives.transmission), motions)
        robot, calibration, motions = beginnings(name, cold)
        early = sum(
            false_events(WatchedPayload(calibration, robot.chain, robot.drives.transmission), [motion])
            for motion in motions
        )
        print(
            f"{name}, friction {cold:+.0%} at first: {count} false events in an hour, {early} in 16 starts (0)",
            flush=True,
        )
    print(f"pushes of {LASTS_S:g} s against {ARM} in MuJoCo: noticed within 0.25, 0.5 s, called a payload")
    for what, joints in (("random motion", (None, None, None)), ("one joint moving (60 N: 80 % in 0.25 s)", (0, 1, 2))):
        for size_n in (30.0, 60.0, 100.0):
            found = [each for seed, joint in enumerate(joints) for each in contacts(size_n, joint, seed)]
            late = np.array([each.noticed_s for each in found])
            called = sum(each.payload and np.isfinite(each.decided_s) for each in found)
            shares = ", ".join(f"{np.mean(late <= s):.0%}" for s in (0.25, 0.5))
            print(f"  {what}, {size_n:3.0f} N: {shares}, {called} of {len(found)}", flush=True)


if __name__ == "__main__":
    main()
