"""Load or push on simulated arms: false events in an hour of empty motion and in cold starts, and contacts in MuJoCo.

    python -m benchmarks.live.simulated_forces [--part starts|pushed|hours] [--first SEED]

The hour and the beginnings are those of `benchmarks.accuracy.simulated_motion`: friction that settles, or differs by a
fifth. A contact is a force of a second on the last link, in MuJoCo itself: the servo loops react to it. It begins at a
random time of a random motion, whose moves end abruptly and pause for 0.3 s; the criteria are for pushes that begin
while three or more joints move.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from itertools import product
from typing import Final

import numpy as np

from armload_controller.config.robot import load_robot
from armload_identification.contact.force_watch import ForceEventKind
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.float_array import FloatArray
from benchmarks.accuracy.simulated_motion import (
    ARMS,
    BEGINNINGS,
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
from benchmarks.live.pushes import MOVING_RAD_S, REQUIRED, Outcome, events_in_time, outcome
from benchmarks.results.tally import Tally

ARM: Final = "prbt"
"""The arm that is pushed."""
FIRST_S, APART_S, LASTS_S = 15.0, 9.0, 1.0
"""Time of the first push, between two, and of one."""
PUSHES: Final = 8
"""Pushes in one motion."""
MOTIONS, FIRST_SEED = 6, 100
"""Number of random motions for each size, and their first seed."""
SWING_RAD, SWING_S = 0.5, 5.0
"""Amplitude and period of a joint that moves alone."""


def false_events(watch: WatchedPayload, motions: Iterable[Signals]) -> int:
    """Number of notices in motions without a force."""
    for motion in motions:
        watch.take(*motion)
    return sum(event.kind is ForceEventKind.ACTING for event in watch.take_events())


def contacts(size_n: float, alone: int | None, seed: int) -> list[tuple[int, Outcome]]:
    """Pushes against the empty arm in random motion, or while one joint moves alone after it.

    Returns:
        Number of joints that move when it begins, and what became of each push.
    """
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
    events = events_in_time(watch, signals)
    moving = np.count_nonzero(np.abs(np.gradient(setpoints, 1.0 / rate_hz, axis=0)) > MOVING_RAD_S, axis=1)
    return [
        (
            int(moving[int(at_s * rate_hz)]),
            outcome([each for each in events if each.time_s < at_s + APART_S - 2.0], at_s),
        )
        for at_s in begun
    ]


def _direction(rng: np.random.Generator) -> FloatArray:
    """(3,) random unit vector that is not vertical."""
    while True:
        vector = rng.normal(size=3)
        vector /= np.linalg.norm(vector)
        if abs(vector[2]) < 0.65:
            return np.asarray(vector)


def starts(tally: Tally) -> None:
    """Starts without a force, friction as calibrated or a fifth off."""
    for name, cold in product(ARMS, (0.0, COLD, -COLD)):
        robot, calibration, motions = beginnings(name, cold)
        arm = calibration, robot.chain, robot.drives.transmission
        count = sum(false_events(WatchedPayload(*arm), [motion]) for motion in motions)
        tally.judge(f"{name}, friction {cold:+.0%}: no false event in {BEGINNINGS} starts", f"{count}", count == 0)


def hours(tally: Tally) -> None:
    """An hour without a force, friction a fifth off at first."""
    for name, cold in product(ARMS, (COLD, -COLD)):
        robot, calibration, motions = an_hour(name, cold)
        count = false_events(WatchedPayload(calibration, robot.chain, robot.drives.transmission), motions)
        tally.judge(f"{name}, friction {cold:+.0%} at first: no false event in an hour", f"{count}", count == 0)


def pushed(tally: Tally, first: int) -> None:
    """Pushes in random motion, and while one joint moves."""
    for random, size_n in product((True, False), (30.0, 60.0)):
        given = [(None, first + seed) for seed in range(MOTIONS)] if random else [(j, first + j) for j in range(3)]
        every = [each for joint, seed in given for each in contacts(size_n, joint, seed)]
        found = [each for moving, each in every if moving >= 3 or not random]
        late = np.array([each.noticed_s for each in found])
        called = sum(each.payload and np.isfinite(each.decided_s) for _, each in every)
        what = f"{size_n:3.0f} N, {'three or more joints' if random else 'one joint'} moving"
        shares = ", ".join(f"{np.mean(late <= s):.0%}" for s in (0.15, 0.25, 0.5))
        print(f"    {what}: {shares} of {late.size} noticed within 0.15, 0.25, 0.5 s", flush=True)
        if random:
            fewer = np.array([each.noticed_s for moving, each in every if moving < 3])
            shares = ", ".join(f"{np.mean(fewer <= s):.0%}" for s in (0.25, 0.5))
            print(f"    {size_n:3.0f} N, fewer: {shares} of {fewer.size} within 0.25, 0.5 s", flush=True)
        print(f"    {size_n:3.0f} N: {called} of {len(every)} called a payload", flush=True)
        if (random, size_n) in REQUIRED:
            within_s, least = REQUIRED[random, size_n]
            share = float(np.mean(late <= within_s))
            tally.judge(f"{what}: {least:.0%} in {within_s:g} s", f"{share:.0%}", share >= least)


def main() -> int:
    """Print the figures beside what is asked for; exit status 1 if a criterion is not met."""
    parts = ("starts", "pushed", "hours")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", action="append", choices=parts, help="by default all")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed of the pushes")
    given = parser.parse_args()
    tally = Tally()
    for part in given.part or parts:
        tally.heading(part)
        if part == "pushed":
            pushed(tally, given.first)
        else:
            {"starts": starts, "hours": hours}[part](tally)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
