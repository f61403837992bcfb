"""`make bench`: every benchmark in one run, each beside its peers.

These figures are this machine's, now: compare within a run, not between runs.
"""

from benchmarks import (
    commissionings,
    cycle,
    estimator_time,
    excitation,
    false_alarms,
    fleet,
    following,
    reading,
    regressor,
    startup,
    stops,
    watching,
)
from benchmarks.peers import generated_code

every = (startup, regressor, cycle, generated_code, stops, commissionings, false_alarms, excitation, following, reading)
for benchmark in (*every, watching, fleet, estimator_time):
    benchmark.run()
