"""`make accuracy`: real currents, other payloads, both plants, coverage of the intervals, the verdict, and speed."""

from __future__ import annotations

import sys

from benchmarks.accuracy import (
    adapting,
    calibrated_arms,
    coverage,
    interval_coverage,
    measured_motion,
    modified_recordings,
    operating_curve,
    other_payloads,
    pair_coverage,
    real_currents,
    simulated_motion,
    speed,
    workpieces,
)
from benchmarks.arms.setups import Twin
from benchmarks.arms.trials import workers
from benchmarks.results.error_statistics import Census
from benchmarks.results.tally import Tally


def main() -> int:
    """Run everything; the exit status is 1 if a criterion is not met."""
    tally, census = Tally(), Census()
    real_currents.run(tally, census)
    operating_curve.run_measured(tally)
    calibrated_arms.run_measured(tally)
    measured_motion.run_measured(tally)
    adapting.run(tally)
    with workers() as pool:
        speed.run(tally, pool)
        pair_coverage.run(tally, pool)
        modified_recordings.run(tally, pool)
        calibrated_arms.run_simulated(tally, pool)
        simulated_motion.run(tally, pool)
        other_payloads.run(tally, pool, Twin.NORMATIVE, census)
        other_payloads.run(tally, pool, Twin.HARSH, census)
        workpieces.run(tally, pool)
        coverage.run(tally, pool, census)
        operating_curve.run(tally, pool, census)
        interval_coverage.run(tally, pool)
    tally.heading("6. Physically possible, and honest")
    census.judge(tally)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
