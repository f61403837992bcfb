"""`make bench`: all benchmarks of time in one run, each compared with other programs.

The figures depend on the machine and its load: compare within a run, not between runs.
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
