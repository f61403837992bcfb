"""`make peers`: armload and other programs on the same tasks, in one run.

CPU times depend on the machine and its load: compare within a run, not between runs.
"""

from benchmarks.peers import excitation_searches, generated_code, payload_fits

for compared in (payload_fits, excitation_searches, generated_code):
    compared.run()
