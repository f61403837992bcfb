"""All numbers of this room that do not depend on the arm: unit, meaning, origin, and what it costs to be wrong by two.

The costs are from `python -m benchmarks.live.pushes` on the UR10e's recorded motion.
"""

from __future__ import annotations

from typing import Final

# ---- rows ----
BIN_S: Final = 0.0095
"""Samples that come faster are averaged over this, as in the recursive estimator, and processed together. Longer: a
push is noticed later by up to this."""
BINS: Final = 9
"""Means in the cubic fit of a row, +-40 ms at 100 Hz. More: later; fewer: a noisier acceleration."""
STEP_S: Final = 0.019
"""Least time between two rows."""
HOLE_S: Final = 0.3
"""Longest time that the means of a row may span."""

# ---- what is known of payload and friction ----
MEMORY_S: Final = 60.0
"""Memory of the motion that predicts the residual."""
CHECKPOINT_S: Final = 0.5
"""Time between two estimates of it."""
OLD_S: Final = 2.0
"""Least age of the estimate that predicts: a younger one has absorbed a slow grasp."""
PART_ROWS: Final = 5
"""Rows that are learnt together."""
REMEMBERED_S: Final = 9.0
"""Rows kept to decide."""

# ---- something acts ----
WINDOWS_S: Final = (0.1, 0.25, 0.5, 1.0)
"""Windows over which the residual is averaged."""
TAIL_SIGMAS: Final = (5.4, 3.7, 3.9, 3.4)
"""Bounds of the test in each window, as standard deviations of a normal variable with the same probability: 48, 28, 30
and 25 for six joints. The short window has many independent values, and sees an arm swing at 5 Hz after it braked,
whose mean over longer ones is none: with 4.8, that was an event in a UR10e's run which began 12 s before."""
WHITE_S: Final = 0.1
"""Time over which the white part of the residual is stated."""
COLOUR_S: Final = 0.5
"""Correlation time of the rest."""
STOPPING: Final = 1.5
"""Share of its friction by which a joint is uncertain that stops, starts or reverses. Half: a joint that stops looks
like a payload."""
STAMP_SIGMAS: Final = 3.0
"""Standard deviations of the inertial torque by stamps that scatter about a smooth motion by which a joint is uncertain
as well. With 1 ms of scatter on the recorded UR10e, which has 1 false event: 41 without, 11 with half, 1 with this.
Twice: no contact of a simulated prbt is noticed later."""
BOUNDED: Final = 0.57
"""Share of that uncertainty which the test for a force subtracts from a residual: friction is bounded. Half: joints
that stop give false events; twice: pushes against slow joints are noticed later."""
UNBOUNDED: Final = 0.33
"""Share of it that is a standard deviation there. The same costs; 0.47 and 0.33 subtracted: 60 N are noticed within
0.25 s in 86 instead of 88 % of 300 pushes while one joint moves."""
SLOW: Final = 3.5
"""Speed below which it is, in reversal speeds; the least speed in a row's window counts. Half: one false event more on
the recorded UR10e; twice: on a simulated prbt 96 instead of 100 % of 46 pushes of 30 N are noticed within 0.25 s (seeds
1000 to 1006)."""
JERK: Final = 0.2
"""Share of the inertial torque of a changing acceleration by which a joint is uncertain."""
QUIET_RAD_S2: Final = 0.4
"""Change of acceleration within a window that has no effect."""
LOOK_S: Final = 0.2
"""Time between two looks for another payload: weaker than the test's bound in any window, but with the columns of a
payload over the last seconds."""
LOOKS_FROM_S: Final = 8.0
"""Time of rows after which they begin: what is known `BACK_S` before must have met the payload. Half: two runs of
20 s of a simulated er50 with 9.8 kg, calibrated from two runs of one motion, have 8 and 8 false events instead of 1 and
3."""
LEAST_SINCE: Final = 2
"""Number of the newest means of `DECISION_STEP_S` in which no onset is sought by a look."""
KNOWN_S: Final = 3.0
"""Time of rows after which the test begins."""

# ---- what it is ----
BACK_S: Final = 2.3
"""Earliest onset before the notice: a slow grasp is noticed late."""
DECISION_STEP_S: Final = 0.1
"""Width of the means by which a decision is made."""
LOOKS_S: Final = (0.3, 0.5, 0.8, 1.1, 1.38, 2.0, 2.5, 2.9)
"""Times after the notice at which it is looked at; at the last one it is decided."""
GRASPED_S: Final = (0.0, 0.2, 0.4)
"""Times within which a payload is grasped. Only 0: three of 40 grasps of 3 kg are called a push."""
INEXACT: Final = 0.05
"""Share by which the mass of a change is wrong because no grasp rises exactly so. None: an abrupt drop without noise
leaves a negative mass of more than three standard deviations, and is called a push."""
FAVOUR: Final = 30.0
"""Log likelihood by which a push must be better than a payload: grasps are no steps, and no arm is its model."""
SURE: Final = 20.0
"""Log likelihood beyond that by which a payload is decided before the last look."""
PUSH_SURE: Final = 60.0
"""The same for a push: a heavy payload that is grasped slowly is far from a step at first."""
PAYLOAD_FROM_S: Final = 1.38
"""Earliest decision for a payload: a part of `BIN_S` later it is known within 1.5 s."""
FORCE_N: Final = 60.0
MOMENT_NM: Final = 10.0
"""Sizes of a push, as prior standard deviations."""
OVER_S: Final = 0.3
"""Time without evidence after which a push is over."""
OUTLASTS_S: Final = 10.0
"""Shortest push that, if it also lasts longer than all that was seen before it, is none: something acted before."""
PAYLOAD_SIZES: Final = (0.05, 0.0125)
"""Sizes of a change of payload, as a share of what the arm's strongest joint can hold at 0.5 m. The larger alone: light
payloads have less evidence; 0.35 kg on a UR10e, seeds 5000 to 5099: 79 instead of 88 % are noticed within 1.5 s."""
HELD_ROWS: Final = 3
"""Rows above the bound that are an event; two rows of a stuttering controller are none."""
AT_ONCE: Final = 3.0
"""Share of the bound above which a single row is."""
WHITE_MEMORY_S: Final = 30.0
"""Memory of the residual's white part, which depends on the drives and is not in a calibration."""
FAR_SIGMAS: Final = 3.0
"""Standard deviations of a joint's residual from which the joint is named."""
STATE_S: Final = 0.5
"""Time between two kept states of the recursive estimator."""
KEPT_S: Final = 12.0
"""Time for which states and samples are kept: an onset before the notice, and the time until a decision."""
SETTLED_S: Final = 0.5
"""Time after the onset until the new payload alone acts: a grasp's duration, and the window of a row."""
EVIDENT: Final = 0.4
"""Share of the bound above which a push is not over: with 1, a weak one is over before it ends, and its end looks like
a payload that is dropped. Quiet motion exceeds it in a row of a thousand."""
EVIDENCE: Final = 8.0
"""Log likelihood by which another payload must be better than nothing at all. Half: a push that has ended is called a
payload of some hundred grams; twice: 0.35 kg takes longer."""
SUSPECT: Final = 7.0
"""The same for a look. The most in motion without another payload is 1.1 on the recorded UR10e, 3.7 where it
stutters, and 4.3 in 132 starts of simulated arms whose friction is as calibrated or a fifth more or less: motions 7000
to 7021; those quoted are from 5000 on. Half: false events there; 10: 0.35 kg is noticed within 3 s in 93 % of 156 cases
instead of 96."""
