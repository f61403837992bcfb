"""`make peers`: armload beside other programs on the same tasks, in one run.

CPU times are this machine's, now: compare within a run, not between runs.
"""

from benchmarks.peers import generated_code, payload_fits

for compared in (payload_fits, generated_code):
    compared.run()
