"""Every number that the calibration has chosen, with its origin and what it costs to be wrong.

A class is a concern, an attribute a constant, as in `estimation_constants`. Factors of two were tried with the tests of
a calibration and with both days of the UR10e: "nothing" is no failing test. Numbers that stay in their modules are
numerical tolerances, counts of steps, or parts of a public signature.
"""

from __future__ import annotations

from typing import Final


class Calibrating:
    """All runs of an arm (`calibrate_arm`)."""

    unmoved_rad_s: Final = 1e-3
    """[rad/s] Greatest speed of a joint that moves in no run.

    Origin: prior, not measured: above the noise of encoders.
    Factor of two: either way: nothing.
    """

    disagrees: Final = 4.0
    """[1] Standard deviations from which two masses or centres of mass differ.

    Origin: mathematics: one correct mass of 16,000 is beyond it.
    Factor of two: either way: nothing.
    """

    mass_off: Final = 2.5
    """[1] Standard deviations from which a weighed mass is questioned; without another one, nominal gains are the data.

    Origin: measured: 10 % too much, as with an adapter that was not weighed, is 2.9 on a 7-axis arm; right masses are
        0.4 on the UR10e.
    Factor of two: twice: such an adapter is not questioned; half: 1 of 126 tests fails.
    """

    lever_m: Final = 0.1
    """[m] Distance from a joint at which the weight of a payload must be within the greatest torque of its run.

    Origin: physics: shorter than any arm's reach; a mass in g is a thousand times too heavy.
    Factor of two: either way: nothing (reasoned: payloads of arms take a hundredth of it).
    """

    suspect: Final = 2.0
    """[1] Residual of a joint, relative to the noise of all runs, from which a fit without the run is tried.

    Origin: prior, not measured: a fit costs time.
    Factor of two: twice: 2 tests fail; half: nothing.
    """

    quieter: Final = 2.0
    """[1] A run that increases a joint's noise in all runs by this factor contradicts them, even if the fit is a
    compromise: by this factor more than any other run does.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    perhaps: Final = 1.5
    """[1] The same by a few steps from the fit of all, from which each of few runs is left out in a fit of its own.

    Origin: cost: right runs of the UR10e and er50 reach 1.08; wrong ones a seventh less than in a fit of their own.
    Factor of two: half: all fits are made, 8.3 s of CPU instead of 4.5 for twelve runs; twice: not measured.
    """

    few: Final = 12
    """[1] Most runs that are left out one by one, because a compromise may fit them all.

    Origin: measured on the UR10e and er50, one current times 0.8 to 1.5: the wrong one of up to seven is 0.8 to 1.9
        times the noise off, and the noise without it 4 to 200 times less; without a right one 1.0 to 1.3 times.
    Factor of two: twice: a calibration of 13 to 24 runs takes longer; half: one of seven is not found.
    """

    unexplained: Final = 0.12
    """[1] Noise of a joint as a share of its torque that is remarked.

    Origin: prior, not measured: right runs of er50 and the UR10e leave 0.002 to 0.037, two that contradict each other
        0.4.
    Factor of two: either way: nothing.
    """

    doubtful: Final = 0.12
    """[1] Share of a joint's torque on other motions from which its error causes a warning.

    Origin: prior, not measured.
    Factor of two: twice: 1 test fails; half: 1 test fails.
    """

    far: Final = 5.0
    """[1] Change of friction, in standard deviations, that causes a warning.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    rows_per_unknown: Final = 3
    """[1] Least number of rows of moving joints per unknown: with fewer, any arm would fit.

    Origin: prior, not measured.
    Factor of two: twice: 1 test fails; half: nothing.
    """

    tried_runs: Final = 4
    """[1] Most runs with which other mountings are tried.

    Origin: cost: the time of a calibration.
    Factor of two: either way: nothing.
    """

    tried_spacing: Final = 3
    """[1] Every how many rows of them.

    Origin: cost: the time of a calibration.
    Factor of two: either way: nothing.
    """


class Contradiction:
    """A run that contradicts the others, and what explains it (`run_contradictions`)."""

    contradicts: Final = 4.0
    """[1] Residual of a joint, relative to the noise of all runs, from which a run contradicts the others.

    Origin: prior, not measured: the UR10e's runs, of any day, deviate by less than 2.
    Factor of two: either way: nothing.
    """

    gross: Final = 0.05
    """[1] Residual of a joint, as a share of its torque, from which a run that no mistake explains is wrong.

    Origin: prior, not measured: right runs of heavy payloads on the harsh prbt leave up to 0.025, 4.6 times the noise.
    Factor of two: twice: damage that leaves 5 to 10 % stays; half: right runs of the harsh prbt are left out.
    """

    explained: Final = 0.4
    """[1] A mistake explains a run if correcting it leaves at most this share of the residual.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    better: Final = 0.7
    """[1] A mistake is preferred to another payload if its residual is at most this share of the payload's.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    same_scale: Final = 0.03
    """[1] Deviation of an axis's effort from its own torque from which a mistake names it.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    as_it_is: Final = 0.3
    """[1] Distance of a factor from -1 within which the sign of an effort is flipped, and nothing else.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    least_scale: Final = 0.01
    """[1] Least factor on an effort, which keeps its correction finite.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    scalings: Final = 3
    """[1] Times that factors on efforts are found one from the other.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    stiff: Final = 0.01
    """[1] Change of friction while these are sought, relative to the usual one: it would absorb part of a factor.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    light_kg: Final = 0.05
    """[kg] Mass below which a run carries nothing.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    light_share: Final = 0.02
    """[1] The same as a share of the stated mass, in addition.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    roughly: Final = 0.3
    """[1] Logarithm within which a stated mass is the found one in grams.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    same_mass: Final = 0.05
    """[1] Relative difference of two masses below which only their mounting or inertia can differ.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    wide: Final = 100.0
    """[kg, kg m, kg m2] Prior standard deviation of a payload of which nothing is known.

    Origin: physics: no arm of this size carries as much.
    Factor of two: either way: nothing.
    """


class Health:
    """One run beside a calibration (`run_health`)."""

    gain: Final = 0.10
    """[1] Prior standard deviation of a gain's change since the calibration.

    Origin: prior, not measured: a magnet or a sensor that lost a tenth.
    Factor of two: UR10e, eight runs of other days: twice: gains by up to 1.3 %, their noise by +7 %; half: gains by up
        to 2.5 %, their noise by -17 %.
    """

    loose: Final = 10.0
    """[1] Prior standard deviation of a change of friction, in multiples of the usual one.

    Origin: prior: wide enough not to matter.
    Factor of two: twice: gains by up to 0.2 %; half: gains by up to 0.7 %, friction by up to 0.03 N m.
    """

    fewest_rows: Final = 20
    """[1] Rows in motion of a moving joint.

    Origin: prior, not measured: 2 s.
    Factor of two: either way: nothing.
    """

    window_s: Final = 60.0
    """[s] Length of a window of friction over time.

    Origin: prior, not measured: gears warm up in minutes.
    Factor of two: either way: as many or as few windows.
    """

    most_windows: Final = 30
    """[1] Most windows of a long run, which are then longer.

    Origin: cost.
    Factor of two: either way: as many or as few windows of runs over half an hour.
    """

    fewest_windows: Final = 3
    """[1] Windows from which friction over time is given.

    Origin: mathematics: fewer show no course.
    Factor of two: twice: runs of 3 to 6 min have no course; half: those of 1 min have one.
    """


class OtherMounting:
    """An arm that is mounted or turned in another way than configured (`mounting_mistakes`)."""

    little: Final = 0.025
    """[1] Greatest geometric mean of the moving joints' residual shares of an arm that is mounted as configured.

    Origin: measured: the UR10e has 0.017 as mounted, and 0.035 or more with any other mounting.
    Factor of two: either way: nothing.
    """

    much: Final = 0.2
    """[1] Residual share of one moving joint from which a joint may be inverted.

    Origin: measured on the UR10e: an inverted joint causes 0.28 or more.
    Factor of two: either way: nothing.
    """

    better: Final = 0.3
    """[1] Least reduction of the logarithm of the joints' noise for another mounting to be accepted.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
