"""`make bench`: every benchmark in one run, each beside its peers.

These figures are this machine's, now: compare within a run, not between runs.
"""

from benchmarks import commissionings, cycle, excitation, export_c, following, reading, regressor, startup, stops

for benchmark in (startup, regressor, cycle, export_c, stops, commissionings, excitation, following, reading):
    benchmark.run()
