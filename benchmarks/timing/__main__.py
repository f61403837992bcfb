"""`make bench`: all benchmarks of time in one run, each compared with other programs.

The figures depend on the machine and its load: compare within a run, not between runs.
"""

from benchmarks.canopen_runs import (
    broken_loops,
    bus_load,
    false_alarms,
    feedforward_worth,
    following,
    ordinary_stops,
    slow_round_speeds,
    small_faults,
    stops,
    wrong_files,
)
from benchmarks.peers import generated_code
from benchmarks.timing import (
    cycle_time,
    design_time,
    estimator_time,
    fleet_throughput,
    loop_process,
    reading_time,
    regressor_time,
    startup,
    watching,
)

for benchmark in (
    startup,
    regressor_time,
    cycle_time,
    loop_process,
    bus_load,
    generated_code,
    stops,
    broken_loops,
    ordinary_stops,
    small_faults,
    wrong_files,
    slow_round_speeds,
    false_alarms,
    design_time,
    following,
    feedforward_worth,
    reading_time,
    watching,
    fleet_throughput,
    estimator_time,
):
    benchmark.run()
