"""Coverage of a pair's intervals with all disturbances together, on an arm of seven joints simulated by Pinocchio only.

Usage: python -m benchmarks.accuracy.pair_coverage
"""

from __future__ import annotations

import sys
from concurrent.futures import Executor

import numpy as np

from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.sagging_panda import PAYLOAD, Effects, SaggingPanda, chain, nominal_transmission
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally

SEEDS = 20
SPREAD = 0.02
HELD = 0.9
OFF = 0.05
SIZES = (0.05, 0.1, 0.2)
SIGNED_SEEDS = 3
"""Number of seeds for each of these sizes and signs."""
CARRYING = (1, 2, 3, 4, 5)
"""Joints that carry the payload. Joint 1 is vertical, and the load of joint 7, 1 N m, is close to its friction."""
QUIET = 0.2
"""Share of the noise at which model errors are most visible."""


def run(tally: Tally, pool: Executor) -> None:
    """Intervals with exact and with nominal gains, and gain errors of 5, 10 and 20 %."""
    tally.heading(f"Coverage under sag, friction, delay and coloured noise: seven joints, {SEEDS} seeds each")
    print(
        "  gains                 | " + "  ".join(f"{name:>4s}" for name in PARAMETER_NAMES) + "   of those determined"
    )
    panda = SaggingPanda(Effects(noise=QUIET))
    for label, spread in (("exact", 0.0), (f"within {SPREAD:.0%}", SPREAD)):
        held, determined = np.zeros(10), np.zeros(10)
        alarms = 0
        for seed in range(SEEDS):
            error = spread * np.random.default_rng([seed, 99]).uniform(-1.0, 1.0, chain().n)
            pair = panda.pair(seed, error, with_phase=True)
            found = identify_runs(*pair, chain(), nominal_transmission(exact=spread == 0.0)).uncertainty
            determined += found.determined
            held += found.determined & (np.abs(found.values - PAYLOAD.values) <= found.half_width_95)
            assumed = identify_runs(*pair, chain(), nominal_transmission(exact=False)) if spread == 0.0 else None
            alarms += 0 if assumed is None or assumed.gains is None else int(assumed.gains.contradicted.sum())
        print(f"  {label:21s} | " + "  ".join(f"{count:4.0f}" for count in held))
        share = held.sum() / max(determined.sum(), 1.0)
        tally.judge(
            f"gains {label}: at least {HELD:.0%} of the values called determined lie in their interval",
            f"{share:.1%} of {determined.sum():.0f}, mass {held[0]:.0f} of {determined[0]:.0f}",
            bool(share >= HELD and held[0] >= HELD * determined[0]),
        )
        if spread == 0.0:
            tally.judge("exact gains that are taken for nominal raise no alarm", f"{alarms} of {SEEDS}", alarms == 0)
    for noise in (QUIET, 1.0):
        _off(tally, pool, noise)
    _sizes(tally, pool)


def _sizes(tally: Tally, pool: Executor) -> None:
    """One gain error of each size and sign: every one must be named."""
    trials = [pool.submit(_each_size, joint) for joint in CARRYING]
    results = np.array([trial.result() for trial in trials])
    errors = [sign * size for size in SIZES for sign in (-1.0, 1.0)]
    for place, error in enumerate(errors):
        named, wrongly, held = results[:, place].T
        tally.judge(
            f"a gain of joints {' '.join(str(joint + 1) for joint in CARRYING)} {error:+.0%} off: named in each of "
            f"{SIGNED_SEEDS} seeds, and no other is",
            f"{named} named, {wrongly.sum()} others, {held} intervals",
            bool(named.min() == SIGNED_SEEDS and not wrongly.any()),
        )


def _each_size(joint: int) -> list[tuple[int, int, int]]:
    """For every size and sign: how often the gain is named, how often another one is, how often its interval holds."""
    panda = SaggingPanda(Effects(noise=QUIET))
    seeds = range(SIGNED_SEEDS)
    return [
        tuple(np.sum([_named(panda, joint, sign * size, seed) for seed in seeds], axis=0).tolist())
        for size in SIZES
        for sign in (-1.0, 1.0)
    ]


def _off(tally: Tally, pool: Executor, noise: float) -> None:
    """A gain error of 5 %, joint by joint."""
    counts = [pool.submit(_one_off, joint, noise) for joint in range(chain().n)]
    named, wrongly, held = np.array([count.result() for count in counts]).T
    text = f"{named} of {SEEDS} named, {wrongly.sum()} others, {held} intervals"
    if noise == QUIET:
        least = np.minimum(named, held)[list(CARRYING)].min()
        tally.judge(
            f"a gain of joints {' '.join(str(joint + 1) for joint in CARRYING)} {OFF:.0%} off: named, no other is, and "
            "its interval holds",
            text,
            bool(least >= HELD * SEEDS and not wrongly.any()),
        )
    else:
        tally.judge(f"the same with {noise / QUIET:.0f} times the noise: no other is named", text, not wrongly.any())


def _one_off(joint: int, noise: float) -> tuple[int, int, int]:
    """How often the gain is named, how often another one is, how often its interval holds."""
    panda = SaggingPanda(Effects(noise=noise))
    trials = [_named(panda, joint, OFF * (-1.0) ** seed, seed) for seed in range(SEEDS)]
    named, wrongly, held = np.sum(trials, axis=0).tolist()
    return named, wrongly, held


def _named(panda: SaggingPanda, joint: int, off: float, seed: int) -> tuple[int, int, int]:
    """Whether a wrong gain is named, how many others are, and whether its interval holds."""
    error = np.where(np.arange(chain().n) == joint, off, 0.0)
    gains = identify_runs(*panda.pair(seed, error, with_phase=True), chain(), nominal_transmission(exact=False)).gains
    if gains is None:
        return 0, 0, 0
    wrongly = int(np.count_nonzero(np.delete(gains.contradicted, joint)))
    held = bool(abs(gains.log_gain[joint] - np.log1p(off)) <= gains.half_width_95[joint])
    return int(gains.contradicted[joint]), wrongly, int(held)


def main() -> int:
    """Run only this part."""
    tally = Tally()
    with workers() as pool:
        run(tally, pool)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
