"""`make bench`: every benchmark in one run, each beside its peers.

These figures are this machine's, now: compare within a run, not between runs.
"""

from benchmarks import commissionings, cycle, excitation, following, reading, regressor, startup, stops
from benchmarks.peers import generated_code

for benchmark in (startup, regressor, cycle, generated_code, stops, commissionings, excitation, following, reading):
    benchmark.run()
