"""Every number by which verdicts are decided, with its origin and what it costs to be wrong.

A class is a concern, an attribute a level. Its docstring states the unit in brackets ([1]: none) and the meaning, then

- Origin: physics, a standard, the measurement that chose it, or "prior, not measured";
- Factor of two: what happens with twice and with half the value. Unless marked as reasoned, this was measured: the
  number is given of those tests of the concern at that time, real data included, that fail. None fails where data are
  far from the level on either side, or where it only decides on words.

What contradicts, differs or has changed is decided by `FalseAlarms`, with a correction where several tests are made at
once. The few thresholds that stay multiples of a standard deviation say why. Numbers that follow from others are
computed from them; plain arithmetic is not listed. The module is cheap to import: the command line needs the tolerance.
"""

from __future__ import annotations

from typing import Final


class FalseAlarms:
    """Probabilities of wrong decisions: the source of all thresholds for "differs", "contradicts" and "has changed"."""

    probability: Final = 0.01
    """[1] Probability that what is sound is called wrong, different or changed: per comparison, or per report.

    Origin: convention; `make accuracy` finds 0 of 400 sound payloads of er50 called wrong.
    Factor of two: either way: 3 of 82 tests fail. Reasoned: F's limit of 3.3 on the UR10e becomes 2.9 or 3.8, the
        smallest noticeable error changes by 5 %, and sound payloads fail twice or half as often.
    """
    power: Final = 0.95
    """[1] Probability with which an error called noticeable is detected.

    Origin: convention, the same as of all intervals.
    Factor of two: half, 0.475: 4 of 82 tests fail, of noticeable errors. Twice is above 1; reasoned: of what is
        missing to 1, twice makes noticeable errors 8 % smaller, half 7 % greater.
    """
    certain_half_widths: Final = 2.0
    """[1] Half widths of a 95 % interval beyond a bound from which an identification is refused: a joint's scale, a
    mass below 0 or a first moment of an empty arm, a weighed mass, a symmetry.

    Origin: mathematics: exceeded by chance in one of 10,000. It is not taken from `deviations`, which gives 1.6 for six
        joints: with that, a joint's scale of 3.5 +- 0.3 would be refused.
    Factor of two: as separate numbers: of a joint's scale, either way: 1 of 42 tests fails; of an empty arm, twice:
        none of 50 tests fails, half: 2 of 50 tests fail, of estimates below 0.
    """

    @classmethod
    def deviations(cls, tests: int) -> float:
        """Standard deviations that the greatest of `tests` sound normal values exceeds with `probability` (Bonferroni).

        Args:
            tests: Number of values judged at once.
        """
        from statistics import NormalDist

        return NormalDist().inv_cdf(1.0 - 0.5 * cls.probability / max(tests, 1))


class AgreementLevels:
    """Comparison of a payload with an independent measurement (`agreement`)."""

    floor_kg: Final = 0.005
    """[kg] Standard deviation of a mass's error that no covariance contains: the servos' sag, remounting.

    Origin: prior, not measured; sag alone made 2 kg on a simulated arm of seven joints 1.6 g wrong.
    Factor of two: either way: none of 59 tests fails. Reasoned: it matters for payloads of less than 1 kg, whose
        tolerance is less than four floors.
    """
    floor_m: Final = 0.001
    """[m] The same of each coordinate of the centre of mass.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 59 tests fails; half: none of 59 tests fails. Reasoned: with twice, differences of 6
        mm are not significant.
    """
    fewest_freedom: Final = 5.0
    """[1] Least degrees of freedom for F: with fewer, limit and noticeable error are practically unbounded.

    Origin: prior; the statistic of four values needs more than 3.
    Factor of two: either way: 1 of 59 tests fails.
    """
    longest_factor: Final = 1000.0
    """[1] Multiple of the present length beyond which runs are called too long to help.

    Origin: prior, not measured: a run of a minute would take 17 hours.
    Factor of two: either way: none of 59 tests fails. Reasoned: it separates "longer runs" from "no run" in the
        advice.
    """
    least_scatter: Final = 1e-9
    """[1] Least scatter of the sum of two covariances, against division by zero.

    Origin: numerics; degrees of freedom are then 2e10, the same as infinite.
    Factor of two: either way: none of 59 tests fails.
    """


class DefaultTolerance:
    """Tolerated error of a payload where the user states none (`tolerance`)."""

    mass_share: Final = 0.02
    """[1] Error of the mass as a share of it.

    Origin: prior; equal to the assumed deviation of a nominal gain.
    Factor of two: twice: 2 of 59 tests fail; half: 1 of 59 tests fails. Reasoned: the user's requirement; what is
        right within it changes in proportion.
    """
    center_m: Final = 0.010
    """[m] Distance of the centre of mass.

    Origin: prior; the smallest noticeable error on the UR10e with runs of 25 s is 9 to 11 mm.
    Factor of two: twice: none of 59 tests fails; half: 1 of 59 tests fails. Reasoned: the user's requirement; with
        half of it the UR10e's runs of 25 s cannot tell.
    """


class ChartLevels:
    """Control charts of a quantity over days (`control_limits`)."""

    limit_deviations: Final = 3.0
    """[1] Standard deviations of the control limits drawn in a chart.

    Origin: Shewhart 1931, and ISO 7870-2: three, exceeded by chance in 0.27 % of the points. The alarm is not raised
        by them but by the changes of level, which follow `FalseAlarms`.
    Factor of two: twice: none of 39 tests fails; half: 1 of 39 tests fails. Reasoned: 1.5 marks one point in 7 of
        an unchanged arm, 6 none.
    """
    expected_runs: Final = 5.0
    """[1] Weight of the expected spread, in differences of runs.

    Origin: prior, not measured: with six runs of its own a chart believes its own spread.
    Factor of two: either way: 4 of 39 tests fail. These are changes near the limit of detection.
    """
    freedom_per_difference: Final = 2.0 / 3.0
    """[1] Degrees of freedom of a mean square successive difference, per run.

    Origin: mathematics; von Neumann 1941: its variance is 3/2 of that of an ordinary variance, (3 r - 4) / (r - 1)^2.
    Factor of two: reasoned: not a choice; the bound of 20 charts of ten runs would be 5.7 or 8.6 standard
        deviations instead of 6.9.
    """
    clipped: Final = 9.0
    """[1] A squared difference is limited to this multiple of the variance from the median one: it may be a change.

    Origin: prior, not measured: three standard deviations, squared.
    Factor of two: either way: none of 39 tests fails. Reasoned: a change of level widens the spread more, or true
        scatter less.
    """
    runs_of_level: Final = 2
    """[1] Least number of runs of a level; a single deviating run is not a change.

    Origin: definition.
    Factor of two: twice: 2 of 39 tests fail; half: 4 of 39 tests fail. Reasoned: changes are named later, or
        outliers are taken for changes.
    """
    tests_per_run: Final = 4
    """[1] Tests at every run of a chart: a change of level or an outlier, upwards or downwards.

    Origin: definition.
    Factor of two: either way: 3 of 39 tests fail. Not a choice; as `FalseAlarms.probability`.
    """


class Correlations:
    """Correlations from which one signal is taken for another, whatever its scale."""

    same: Final = 0.9
    """[1] Two measurements of the same quantity, one in another unit; also the torque of a lightly loaded joint and
    the links' weight: friction of a wrist can resemble a weight in a short run.

    Origin: prior, not measured.
    Factor of two: half: none of 83 tests fails. Twice is above 1; reasoned: of what is missing to 1, twice takes
        friction of a wrist for a weight, half misses units in noisy runs.
    """
    weight: Final = 0.6
    """[1] The most loaded joint's torque and the links' weight: friction and inertia are the rest.

    Origin: prior, not measured.
    Factor of two: half: none of 83 tests fails. Twice is above 1; reasoned: with 0.9 wrong units of fast runs are
        missed, with 0.3 a motion that only resembles the weight's is judged.
    """
    derivative: Final = 0.5
    """[1] Least correlation of a change of position with the integral of its velocity.

    Origin: 0.9999 on the UR10e; columns that are exchanged have one near 0, flipped ones near -1.
    Factor of two: half: none of 83 tests fails. Twice, 1.0: 3 of 83 tests fail, as nothing measured reaches it.
    """
    velocity: Final = 0.99
    """[1] Correlation of a change of position with the integral of the current or torque, on every moving joint, from
    which that is a velocity.

    Origin: velocities of the UR10e have 1.000 on all joints; its currents 0.05 to 0.14 on the joint with the least.
    Factor of two: half: reasoned: currents of slow runs, mostly friction, come near. Twice is above 1.
    """
    opposed: Final = -0.8
    """[1] A joint's torque and the one that the other joints imply, below which its sign is flipped.

    Origin: prior, not measured; a sound joint has one near 1.
    Factor of two: half, -0.4: none of 83 tests fails. Twice is below -1: 1 of 83 tests fails, as nothing is found.
    """


class ArmFit:
    """When links and friction of the arm explain a run (`column_mistakes`, `operator_notes`)."""

    residual_share: Final = 0.3
    """[1] Residual of a joint, as a share of its torque, that a sound run does not reach.

    Origin: 0.02 to 0.05 on the four runs of the UR10e with its own links fitted, at most 0.24 at a wrist.
    Factor of two: twice: 1 of 74 tests fails; half: none of 74 tests fails. Half is below the 0.24 of the UR10e's
        sound wrist, reasoned: a note on it.
    """
    driven_share: Final = 0.05
    """[1] Share of a joint's torque from which friction that drives the arm is evidence of a mistake in its columns.

    Origin: prior, not measured; friction of a sound joint is positive. A sign needs friction beyond its error as well.
    Factor of two: either way: none of 74 tests fails.
    """
    driven_share_noted: Final = 0.02
    """[1] The same for a note, which costs less than a refusal.

    Origin: prior, not measured.
    Factor of two: either way: none of 74 tests fails.
    """
    loaded_over_unloaded: Final = 0.2
    """[1] Least slope of a joint's loaded on its unloaded torque, of which the arm itself causes the greater part.

    Origin: prior, not measured: a sound joint has 1 or more, a flipped one -1.
    Factor of two: either way: none of 74 tests fails. Sound and flipped joints are far from it.
    """
    noisier: Final = 15.0
    """[1] Multiple of the calibration's noise on a joint from which a note is given.

    Origin: measured: 0.7 to 3 in pairs of er50, prbt and the UR10e, up to 11 with gears that lose more in one
        direction; on prbt 26 and more with rows at 21 Hz and with a push of 50 N.
    Factor of two: either way: none of 74 tests fails. Reasoned: half: notes on such gears.
    """
    rows: Final = 400
    """[1] Samples of a run, or poses of a motion, to which checks are thinned that need no more.

    Origin: prior, not measured.
    Factor of two: either way: none of 74 tests fails. Reasoned: time in proportion.
    """
    ridge: Final = 1e-4
    """[1] Prior on the normalised parameters, against directions that the motion does not determine.

    Origin: numerics.
    Factor of two: either way: none of 74 tests fails.
    """
    equally_good: Final = 0.01
    """[1] Residuals below this share of the torque are equally good.

    Origin: below the 0.02 that sound runs of the UR10e reach.
    Factor of two: either way: none of 74 tests fails.
    """
    evident_gain: Final = 1.5
    """[1] Decrease of the sum of the logarithms of the residuals from which a mistake is evident without friction.

    Origin: prior, not measured; one flipped sign on the UR10e increases the sum by 1.2 or more.
    Factor of two: either way: none of 74 tests fails.
    """
    no_worse: Final = 0.5
    """[1] Increase of that sum that a correction may cost if the friction drives the arm as it is.

    Origin: prior, not measured.
    Factor of two: either way: none of 74 tests fails.
    """
    all_signs_joints: Final = 8
    """[1] Up to this many joints every combination of signs is tried, otherwise one and two.

    Origin: prior, not measured; these are 256 combinations.
    Factor of two: twice: none of 74 tests fails; half: 1 of 74 tests fails. Reasoned: time doubles with every
        joint.
    """


class PayloadFit:
    """When a payload explains the difference of two runs (`operator_notes`)."""

    poor_share: Final = 0.5
    """[1] Share of the torque that remains unexplained from which a note is given: of the power of all joints together,
    of the RMS of one.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 71 tests fails; half: none of 71 tests fails.
    """
    loud: Final = 5.0
    """[1] Multiple of the noise from which a joint's torque is evidence about the arm.

    Origin: prior, not measured: a signal-to-noise ratio, not a test.
    Factor of two: either way: none of 71 tests fails. Reasoned: notes on joints that carry next to nothing, or none
        on weak ones.
    """
    fewest_periods: Final = 2
    """[1] Periods from which their scatter gives the noise.

    Origin: definition.
    Factor of two: twice: none of 71 tests fails; half: 1 of 71 tests fails.
    """
    unjudged_gain: Final = 0.08
    """[1] Error of a gain, as a logarithm, that a pair should detect; a note is given if it may not.

    Origin: prior; four assumed deviations of a nominal gain.
    Factor of two: either way: none of 71 tests fails. Reasoned: only which gains are noted as unchecked.
    """
    unlimited_gain: Final = 0.5
    """[1] Detectable error from which a pair detects practically none: no gain is expected to be that wrong.

    Origin: prior, not measured; the greatest error of a nominal gain seen is 0.048, joint 5 of the UR10e.
    Factor of two: either way: none of 71 tests fails. Reasoned: only the wording of that note.
    """
    apart_rad: Final = 0.005
    """[rad] RMS difference of a joint's positions in two runs of one motion above which it is noted.

    Origin: half of what is always allowed (`SamePath.rms_rad`). Servos sag by up to 4e-4 under a payload; a zero that
        moves by 1 deg between the runs shifts the UR10e's centres of mass by twice their interval.
    Factor of two: twice: none of 53 tests fails; half: those fail whose given pair is 5 mrad apart.
    """


class ColdArm:
    """Whether friction is still that of the calibration (`friction_validity`)."""

    far_deviations: Final = 5.0
    """[1] Change of a joint's friction, in standard deviations of drift between runs and fit together.

    Origin: prior, not measured. A change of normal values exceeds it with exp(-12.5), once in 270,000 runs and
        joints. It is not taken from `FalseAlarms`, which gives 3.6 for six joints: the drift is that of few runs, and
        the adaptation of the feed-forward asks at every estimate, where 1 % each is too many.
    Factor of two: twice: 2 of 54 tests fail; half: 1 of 54 tests fails. Reasoned: half makes false alarms of 4 % of
        runs and joints with normal values, twice never warns of a cold arm whose friction is five times as far off
        as usual.
    """


class EmptyArmLevels:
    """When runs prove that an arm carries nothing (`nothing_mounted`)."""

    torque_share: Final = 0.04
    """[1] Torque of the greatest mass that the interval allows, as a share of the empty arm's own.

    Origin: prior, not measured: an arm's rated payload takes as much torque as a third of the arm or more, so that less
        than an eighth of that is left. Empty runs of er50, prbt and the UR10e have 0.1 to 0.5 %; gains that may have
        drifted by 1 % since the calibration add 2 %.
    Factor of two: either way: none of 50 tests fails.
    """
    left_share: Final = 0.3
    """[1] Torque that the fit leaves unexplained, as a share of the empty arm's own, above which it may be a payload.

    Origin: measured: empty runs of seven simulated arms leave 0.3 to 5 %, up to 22 % if a light arm's friction differs
        by a quarter between them; payloads with gravity of a wall or joints in reverse order 50 to 120 %.
    Factor of two: either way: 1 of 51 tests fails. Reasoned: wrong gravity ends in "nothing mounted", or an empty arm
        with cold gears does not.
    """


class PayloadChangeLevels:
    """When a payload changed during a run (`operator_notes`)."""

    statistic: Final = 24.0
    """[1] Greatest statistic of a change of mass and first moments over 40 times, above which it is noted.

    Origin: chi-squared with four degrees of freedom exceeds it with a probability of 8e-5, at 40 dependent times with
        one of 0.3 % at most. Constant payloads of simulated arms
        exceeded it in 2 of 1,280 tests, those of the UR10e reached 12; of 72 changed ones the least was 26.
    Factor of two: either way: none of 8 tests fails.
    """
    edge_s: Final = 6.0
    """[s] Time at the start and the end of a run in which no change is looked for.

    Origin: friction of the first seconds after standstill looks like one: on a pair of the UR10e 47 with changes from
        3.3 s on, 20 from 5.4 s on and 12 from 6.2 s on.
    Factor of two: either way: none of 8 tests fails.
    """
    push: Final = 30.0
    """[1] Greatest statistic of a force of two seconds over 40 times, above which a push is noted.

    Origin: chi-squared with three degrees of freedom exceeds it with a probability of 1e-6, at 40 dependent times with
        one of 6e-5 at most; in 1,280 simulated runs that nothing touched the greatest was 25.3, of 64 pushes by 30 or
        60 N for 2 s the least 39.0.
    Factor of two: twice: one in seven of these pushes is not noted; half: one in seven untouched runs is.
    """
    apart_s: Final = 1.0
    """[s] Distance of the parts that are identified from the time of a change.

    Origin: times are tried a fortieth of the run apart, 1.3 s in 50 s.
    Factor of two: twice: 4 of 8 tests fail; half: 1 of 8 tests fails.
    """


class Timing:
    """Times that do not belong together (`operator_notes`)."""

    other_speed_share: Final = 0.05
    """[1] Difference of a period from its excitation's from which it was streamed at another speed, not mistimed.

    Origin: prior, not measured: the least step of a speed override.
    Factor of two: twice: 1 of 9 tests fails; half: none of 9 tests fails.
    """
    late_s: Final = 0.02
    """[s] Delay of the torque that is noted: one standard deviation of what is assumed of it (`Priors.delay_s`).

    Origin: the delays found are 1.0 to 1.4 ms on simulated arms, -0.3 ms on the UR10e; joint torque that is
        filtered at 10 Hz has 16 ms.
    Factor of two: twice: 2 of 9 tests fail; half: 1 of 9 tests fails.
    """


class Magnitudes:
    """Magnitudes that no recording of an arm has in the right units (`impossible_magnitudes`)."""

    beyond: Final = 3.0
    """[1] Multiple of the arm's own limit (range, speed, rated payload) from which another unit or arm is the cause.

    Origin: speeds reach at most 0.88 of their limit on er50, prbt and the UR10e; degrees cause a factor of 57.
    Factor of two: twice: 2 of 19 tests fail; half: 1 of 19 tests fails. Reasoned: 1.5 refuses files with limits of
        a slow test, 6 is still far from 57.
    """
    strongest: Final = 20.0
    """[1] Multiple of a joint's greatest torque that no drive reaches even briefly; wrong units cause a factor of 1000.

    Origin: prior, not measured.
    Factor of two: either way: none of 19 tests fails. Reasoned: units cause 1000.
    """
    outside_rad: Final = 0.2
    """[rad] Distance beyond a joint's range that is always allowed, as zero positions differ.

    Origin: prior, not measured.
    Factor of two: either way: none of 19 tests fails.
    """
    outside_share: Final = 0.1
    """[1] The same as a share of the range.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 19 tests fails; half: none of 19 tests fails.
    """
    other_speeds: Final = 1.2
    """[1] Multiple of its greatest speed within which every other joint must stay for limits to be trusted.

    Origin: prior, not measured.
    Factor of two: twice: none of 19 tests fails; half: 1 of 19 tests fails.
    """
    speed_over_s: Final = 0.1
    """[s] Time over which speeds are taken, so that an encoder's noise does not count.

    Origin: prior, not measured.
    Factor of two: either way: none of 19 tests fails.
    """
    percentile: Final = 99.0
    """[%] Percentile that stands for the greatest value, so that single faulty samples do not count.

    Origin: prior, not measured.
    Factor of two: twice: 12 of 19 tests fail; half: 1 of 19 tests fails.
    """
    weight_share: Final = 0.02
    """[1] Share of the greatest torque from which the links' weight is visible in a joint's torque.

    Origin: prior, not measured.
    Factor of two: either way: none of 19 tests fails.
    """
    wrong_scale: Final = 10.0
    """[1] Factor between measured torque and the links' weight, either way, from which unit or gear side is wrong.

    Origin: links are known within tens of per cent; gear ratios are 50 and more, units cause 1000.
    Factor of two: either way: none of 19 tests fails.
    """
    low_scale: Final = 0.8
    """[1] Torque of the most loaded joint, relative to the links' weight, below which an unloaded run gets a note.

    Origin: right files: 0.96 to 1.18 in 20 runs of prbt, a 7-axis arm and the UR10e with its URDF; 0.86 to 1.19 in 32
        simulated runs of eight arms whose links are up to 15 % lighter or heavier; lbf ft gives 0.74, RMS for
        amplitude 0.71.
    Factor of two: twice: right runs get the note; half: pound-feet get none.
    """
    high_scale: Final = 1.35
    """[1] The same from above: a tool that stays on the arm adds to it, 2.8 kg on a UR10e 0.3.

    Origin: as of `low_scale`.
    Factor of two: half: right runs get the note; twice: 1 of 483 tests fails.
    """
    milli_within: Final = 3.0
    """[1] Factor of 1000 within which a scale is explained by milliampere or N mm.

    Origin: prior, not measured.
    Factor of two: either way: none of 19 tests fails.
    """
    lightest_share: Final = 1e-3
    """[1] Share of the rated payload below which a mass is too small to show in the arm's torques.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 19 tests fails; half: none of 19 tests fails.
    """


class JointScaleLevels:
    """Measured over predicted payload torque, joint by joint (`joint_scales`)."""

    determined_within: Final = 0.05
    """[1] Greatest 95 % half width of a determined scale.

    Origin: prior, not measured.
    Factor of two: either way: none of 57 tests fails. Reasoned: more or fewer joints are named; no outcome changes.
    """
    matters: Final = 0.01
    """[1] Least deviation that is reported.

    Origin: the UR10e's joints 2 to 6 agree within this with calibrated gains.
    Factor of two: either way: none of 57 tests fails. Reasoned: joints with calibrated gains that differ by 0.5 %
        are named, or gains 2 % off are not.
    """
    rank: Final = 1e-9
    """[1] Relative length of a column, or singular value, below which it is linearly dependent.

    Origin: numerics.
    Factor of two: either way: none of 57 tests fails. Reasoned: nothing; between rounding, 1e-15, and any motion's
        share.
    """


class EnoughMotion:
    """Motion of a run of any motion (`motion_quality`)."""

    joint_counts_s: Final = 1.0
    """[s] Shortest time of motion for which a joint counts as moving.

    Origin: prior, not measured; twice the time over which residuals are correlated.
    Factor of two: either way: none of 20 tests fails. Reasoned: runs with 1 to 2 s of motion are refused, or some
        with half a second judged by their intervals alone.
    """
    fewest_joints: Final = 2
    """[1] Joints that must move, unless the arm has fewer.

    Origin: physics; a single axis cannot tell mass from distance.
    Factor of two: twice: 6 of 20 tests fail; half: 1 of 20 tests fails. Reasoned: twice refuses runs of three
        joints that determine a payload; half accepts a single joint, whose result is then judged by its interval
        alone.
    """
    enough_s: Final = 5.0
    """[s] Time of motion of a joint from which more is not asked for.

    Origin: prior, not measured.
    Factor of two: either way: none of 20 tests fails. Reasoned: the advice, and the share of joints that is
        reported as moving long enough.
    """
    brisk_rad_s: Final = 0.3
    """[rad/s] Speed recommended to the operator, at most.

    Origin: prior, not measured.
    Factor of two: either way: none of 20 tests fails. Reasoned: only the advice changes.
    """
    brisk_share: Final = 0.5
    """[1] The same as a share of the speed usual in the calibration.

    Origin: prior, not measured.
    Factor of two: either way: none of 20 tests fails. Reasoned: only the advice changes.
    """
    recommended_s: Final = 10.0
    """[s] Duration recommended to the operator; twice what is enough.

    Origin: prior, not measured.
    Factor of two: either way: none of 20 tests fails. Reasoned: only the advice changes.
    """


class RunLevels:
    """Faults of one recording (`usable_runs`)."""

    evident_travel_rad: Final = 0.05
    """[rad] Travel from which a joint's torque must change; also the distance from start to end of a closed motion.

    Origin: prior, not measured; five times the travel of a joint that moves at all.
    Factor of two: either way: none of 64 tests fails. Reasoned: twice overlooks a dead column of a joint that moves
        by 5 degrees; half refuses one whose friction holds a quantised torque.
    """
    far_share: Final = 0.2
    """[1] Share of a joint's greatest effort from which a value is far from 0; with `far_units`, of its resolution.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 483 tests fails; half: none.
    """
    far_units: Final = 20.0
    """[1] Least size of such a value, in the joint's smallest step: coarse values toggle about 0.

    Origin: prior, not measured.
    Factor of two: either way: none of 483 tests fails.
    """
    missing_share: Final = 0.01
    """[1] Share of rows with an effort of 0 between two that are far from it, from which values are missing.

    Origin: each per cent of zeros makes a mass 1 % too small; 28 right runs have at most 0.05 %, noise alone 0.3 %.
    Factor of two: either way: none of 483 tests fails.
    """
    lost_to_means: Final = 0.01
    """[1] Share of the motion's amplitude that means of long runs may cost.

    Origin: prior, not measured.
    Factor of two: either way: none of 64 tests fails. Reasoned: the error of inertial torque that is accepted, in
        proportion; runs of an hour are refused later or sooner.
    """
    fed_energy: Final = -0.03
    """[1] Least ratio of the work of all joints to their total energy exchange: friction makes the work positive.

    Origin: prior, not measured; without friction it is 0 for the arm. Of single joints it is not asked: 12 of 20 sound
        frictionless runs of a Panda were refused.
    Factor of two: either way: none of 64 tests fails. Reasoned: the work of a joint with a flipped sign counts
        twice, which exceeds either value if it is not a light one.
    """
    zero_share: Final = 0.01
    """[1] Share of a joint's greatest torque from which its least torque, if none is negative, has come to zero.

    Origin: prior, not measured; an absolute value comes as near to zero as its noise and resolution.
    Factor of two: either way: none of 24 tests fails. Reasoned: nothing; a joint that holds weight stays far above.
    """
    velocity_parts: Final = 200
    """[1] Parts of a run over which its velocity is integrated.

    Origin: prior, not measured.
    Factor of two: either way: none of 64 tests fails. Reasoned: nothing; 100 parts still show 0.9999 against 0.
    """
    gap: Final = 5.0
    """[1] Multiple of the usual interval from which the velocity between two samples is unknown.

    Origin: prior, not measured.
    Factor of two: either way: none of 64 tests fails. Reasoned: nothing but for recordings with many gaps.
    """
    degree_within: Final = 0.2
    """[1] Logarithm of the ratio of position to velocity within which it is that of a degree to a radian.

    Origin: prior; the ratio's logarithm is 4.05, so that any error below 1 would do.
    Factor of two: either way: none of 64 tests fails. Reasoned: nothing; the logarithm is 4.05 in degrees and 0 in
        radians.
    """
    stuck_share: Final = 0.1
    """[1] Share of its range of motion that no joint moves back and forth with the same torque.

    Origin: at most 1e-4 on er50, prbt and the UR10e with torques in steps of 1 % of the greatest possible one, and
        0.025 in steps of a fifth of the run's.
    Factor of two: either way: none of 64 tests fails. Sound runs reach 0.025 at most.
    """
    saturated_repeats: Final = 7
    """[1] Repetitions in succession of a signal's greatest value that noise does not produce.

    Origin: prior, not measured.
    Factor of two: either way: none of 64 tests fails. Reasoned: short saturation is overlooked, or coarse torques
        of slow runs are refused.
    """
    saturated_over_others: Final = 3
    """[1] Factor by which they must also exceed those of any other value, for signals of coarse resolution.

    Origin: prior, not measured.
    Factor of two: twice: none of 64 tests fails; half: 1 of 64 tests fails. Reasoned: as for `saturated_repeats`.
    """


class JointContradiction:
    """A joint against all others (`pair_contradictions`)."""

    unexplained: Final = 0.1
    """[1] Share of a joint's power that a sound fit leaves unexplained at most.

    Origin: prior, not measured.
    Factor of two: twice: 1 of 42 tests fails; half: none of 42 tests fails. Reasoned: half examines more sound
        pairs, which costs a fit per joint; twice leaves some wrong joints to the gains.
    """
    gain_factor: Final = 3.0
    """[1] Greatest error of a nominal gain, as a factor either way: beyond it, no payload can be trusted.

    Origin: prior, not measured.
    Factor of two: twice: 4 of 42 tests fail; half: 6 of 42 tests fail. Reasoned: twice lets a gain that is wrong by
        3 to 6 into the fit, half refuses gains wrong by 1.5, which a fit corrects.
    """
    least_share: Final = 0.75
    """[1] Share of the implied torque from which a joint whose gain is not fitted is accepted.

    Origin: sound joints of er50, prbt and the UR10e measure 0.89 to 1.06 of what the others imply.
    Factor of two: twice: 2 of 42 tests fail; half: 1 of 42 tests fails.
    """
    of_friction: Final = 0.1
    """[1] Share of a joint's friction from which the payload's torque is evidence about its gain.

    Origin: 0.3 kg on a joint of prbt that it loads with a hundredth of its friction was refused without it.
    Factor of two: either way: 1 of 42 tests fails. Reasoned: half refuses light payloads on joints of much
        friction; twice overlooks wrong gains there.
    """
    implied_deviations: Final = 20.0
    """[1] Standard deviations, for white noise, of the torque that the others imply, from which it is evidence.

    Origin: measured: sound joints then measure 0.89 to 1.06 of what the others imply. It is not taken from
        `FalseAlarms`: it asks for an accuracy of 5 %, not whether there is a torque at all.
    Factor of two: either way: none of 42 tests fails.
    """
    clear_deviations: Final = 5.0
    """[1] RMS of a joint's torque, in standard deviations of a mean over all samples, from which it is compared.

    Origin: prior, not measured. It is not taken from `FalseAlarms`: it only leaves out joints whose torque is smoothed
        noise, as the RMS does not become smaller with more samples.
    Factor of two: either way: none of 42 tests fails. It is nearly always exceeded.
    """


class VerdictText:
    """Wording of a verdict (`verdict_text`)."""

    along: Final = 0.9
    """[1] Cosine from which a direction is named after an axis.

    Origin: prior; 26 degrees.
    Factor of two: half: none of 25 tests fails. Twice is above 1; reasoned: only the wording changes.
    """
    level_share: Final = 0.5
    """[1] Mean square sine of the angle to gravity below which poses with that direction horizontal are recommended.

    Origin: prior; 2/3 is that of random directions.
    Factor of two: either way: none of 25 tests fails. Reasoned: only the advice changes.
    """
    least_longer: Final = 1.1
    """[1] Least multiple of the length that is recommended.

    Origin: prior; less is not noticed.
    Factor of two: either way: none of 25 tests fails. Reasoned: only the advice changes.
    """
