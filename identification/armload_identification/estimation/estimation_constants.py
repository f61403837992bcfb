"""Every number that the estimation has chosen, with its origin and what it costs to be wrong.

A class is a concern, an attribute a constant, as in `signal_constants`. Factors of two were tried with four
identifications with nominal gains, of which the greatest change is given: a pair of the UR10e, er50 and prbt with
torque wrong within 2 %, and er50 with two periods of 2 s. "Nothing" is less than 0.01 % of the mass, 0.05 mm of the
centre of mass and 1 % of an interval, with the same notes. Numbers that stay in their modules are numerical tolerances.
"""

from __future__ import annotations

from typing import Final


class Rows:
    """One run as equations (`arm_rows`)."""

    model_parts: Final = 8.0
    """[1] The model's samples in half a row's window.

    Origin: measured: twice as many change no gain of the UR10e by 0.01 %.
    Factor of two: twice: nothing; half: masses by up to 0.05 %, centres by up to 0.05 mm, intervals by +0 to +1 %.
    """

    row_s: Final = 0.1
    """[s] Time between rows: a third of the window, so that nothing between them is lost.

    Origin: mathematics, from the window of `RowMean`.
    Factor of two: twice: masses by up to 1.32 %, centres by up to 14 mm, intervals by -1 to +1 %, other notes on 2
        of 4; half: masses by up to 0.08 %, centres by up to 7.1 mm.
    """

    fewest: Final = 100
    """[1] Fewest rows of a period; in a short one they are closer together, below 5 s with shorter windows.

    Origin: measured: 60 simulated er50 with periods of 2 s: masses 1.4 % off (rms), with 20 rows 2.3 %, with 50 1.5
        %. With windows that were shorter from 10 s on, prbt's, of 5 s, showed the ringing of elastic joints: inertias
        were twice as far off as their intervals said. Never shorter, they hide what periods of 2 s tell.
    Factor of two: twice: masses by up to 1.32 %, centres by up to 14 mm, intervals by -1 to +0 %, other notes on 2
        of 4; half: masses by up to 0.04 %, centres by up to 2 mm.
    """

    most: Final = 1500
    """[1] Most rows of one run; in a longer one they are further apart.

    Origin: cost: the time of a solve is linear in them.
    Factor of two: either way: nothing.
    """

    hole_s: Final = 0.1
    """[s] Gap between samples that a row does not bridge.

    Origin: prior, not measured: ten cycles of a slow drive.
    Factor of two: either way: nothing.
    """

    rounding_s: Final = 1e-9
    """[s] Rounding of times.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    rounding: Final = 1e-6
    """[samples] Rounding of lengths: the interval of an average period differs in its last digits between computers.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    stands_rad_s: Final = 1e-3
    """[rad/s] Greatest speed of a joint that stands.

    Origin: prior, not measured: above the noise of encoders behind the low-pass.
    Factor of two: either way: nothing.
    """

    shortest_s: Final = 3.0
    """[s] Shortest run of any motion.

    Origin: prior, not measured: a few windows.
    Factor of two: either way: nothing.
    """

    at_once: Final = 64
    """[1] Windows whose regressor is computed together.

    Origin: cost: it takes 4 MB.
    Factor of two: either way: nothing.
    """

    tilted: Final = 0.9
    """[1] Cosine to gravity above which another axis is taken for the sideways directions.

    Origin: mathematics.
    Factor of two: either way: nothing.
    """


class Priors:
    """What is known of any arm before a run (`arm_terms`)."""

    gain: Final = 0.05
    """[1] Standard deviation of the logarithm of a nominal gain in a calibration.

    Origin: prior: tolerances of catalogue values.
    Factor of two: either way: nothing.
    """

    delay_s: Final = 0.02
    """[s] Standard deviation of the delay of the torque.

    Origin: prior, not measured: a few cycles of a drive.
    Factor of two: twice: centres by up to 0.05 mm; half: masses by up to 0.01 %, centres by up to 0.43 mm.
    """

    recorder_s: Final = 0.005
    """[s] Standard deviation of the delay's difference between two recorders.

    Origin: prior, not measured: a cycle of another recorder.
    Factor of two: with nominal gains nothing, as it is of calibrated arms. On the UR10e, twice: masses from 20 s of any
        motion by 0.02 % (median); half: by 0.03 %.
    """

    load_friction: Final = 0.05
    """[1] Mean and standard deviation of mu: gears lose 0 to 15 % of their load.

    Origin: prior: what gears of arms lose.
    Factor of two: twice: masses by up to 0.09 %, centres by up to 2.7 mm, intervals by +0 to +2 %; half: masses by
        up to 0.08 %, centres by up to 6.5 mm, intervals by -1 to +0 %.
    """

    rotor: Final = 0.25
    """[1] Mean of a rotor's inertia, as a share of the rotor that alone would explain the torque: where a fit
    starts.

    Origin: physics: a rotor is not negative, and links have the larger share. From 0, the paper's motion of one
        harmonic ends with a rotor of -31 instead of 36 kg m2 on joint 1, and c_z 10 instead of 6 mm off.
    Factor of two: twice: nothing; half: on the paper's motion, as from 0.
    """

    wide: Final = 10.0
    """[1] Standard deviation of other parameters, in multiples of the value that alone would explain a joint's
    torque.

    Origin: prior: wide enough not to matter.
    Factor of two: twice: masses by up to 0.02 %, centres by up to 0.25 mm, intervals by -1 to +0 %; half: masses by
        up to 0.02 %, centres by up to 0.21 mm.
    """

    hand_m: Final = 0.1
    """[m] Length of an arm's last link.

    Origin: physics.
    Factor of two: twice: masses by up to 0.02 %, centres by up to 0.25 mm, intervals by -1 to +0 %; half: centres
        by up to 0.06 mm.
    """

    tool_m: Final = 0.5
    """[m] Size of a payload.

    Origin: physics.
    Factor of two: twice: centres by up to 0.06 mm; half: nothing.
    """

    drift_freedom: Final = 20.0
    """[1] nu: degrees of freedom of what is stated of the changes of a calibration's runs.

    Origin: measured: with 0.02, gains of simulated arms, whose friction does not change, are up to 45 % more
        accurate, but those of joint 3 of the UR10e from disjoint runs differ by 0.58 instead of 0.38 %; with 0,
        what the data do not show would become 0.
    Factor of two: either way: nothing.
    """

    within_hours_freedom: Final = 5.0
    """[1] The same of two runs, which show themselves whether their friction differs.

    Origin: measured: with 20, 13 kg on er50, whose friction does not change, are 18 instead of 15 g off (rms); the
        UR10e's masses differ by 0.01 %.
    Factor of two: twice: masses by up to 0.03 %, centres by up to 0.26 mm; half: masses by up to 0.03 %, centres by
        up to 0.26 mm, intervals by -1 to +0 %.
    """

    least_friction: Final = 0.01
    """[1] Least friction, as a share of the joint's torque.

    Origin: physics: no gear is without.
    Factor of two: either way: nothing.
    """


class Solver:
    """The one solve (`solve`)."""

    huber: Final = 2.0
    """[1] Residual in standard deviations from which a row has less weight.

    Origin: mathematics: 95 % efficient on normal noise at 1.35, 99 % at 2.
    Factor of two: twice: masses by up to 0.86 %, centres by up to 2.2 mm, intervals by -2 to +2 %, other notes on 1
        of 4; half: masses by up to 0.21 %, centres by up to 3.3 mm, intervals by -11 to +0 %.
    """

    lags: Final = 25
    """[1] Most rows over which the autocorrelation of the noise is summed.

    Origin: prior, not measured: 2.5 s.
    Factor of two: twice: masses by up to 0.02 %, centres by up to 0.18 mm; half: masses by up to 0.03 %, centres by
        up to 0.24 mm, intervals by -1 to +0 %.
    """

    fewest_rows: Final = 8
    """[1] Moving rows of an axis from which its noise is estimated.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    uncorrelated: Final = 0.05
    """[1] Autocorrelation at which the sum ends.

    Origin: prior, not measured: below the scatter of a few hundred rows.
    Factor of two: twice: masses by up to 0.23 %, centres by up to 0.1 mm; half: masses by up to 0.02 %, centres by
        up to 0.08 mm.
    """

    deviates: Final = 3.0
    """[1] RMS residual of a run on any joint, relative to the noise of all runs, from which its weight is
    reduced.

    Origin: prior, not measured.
    Factor of two: twice: nothing; half: masses by up to 0.02 %.
    """

    moving: Final = 0.3
    """[1] Weight from which a joint counts as moving in a row, mainly for the noise.

    Origin: prior, not measured.
    Factor of two: twice: masses by up to 0.04 %, centres by up to 0.3 mm; half: masses by up to 0.04 %, centres by
        up to 1.1 mm.
    """

    outlying: Final = 3.0
    """[1] Residual in standard deviations by the median at which it is clipped for the noise.

    Origin: mathematics: one row of 370 is beyond it by chance.
    Factor of two: twice: masses by up to 0.09 %, centres by up to 1.9 mm; half: masses by up to 1.73 %, centres by
        up to 7.5 mm, intervals by -1 to +3 %.
    """

    steps: Final = 100
    """[1] Most iterations.

    Origin: cost: fits take 10 to 20; one of 80 simulated calibrations took 42.
    Factor of two: either way: nothing.
    """

    rough_steps: Final = 5
    """[1] Iterations in which priors that are shares of other values are adapted and no row is excluded.

    Origin: prior, not measured.
    Factor of two: twice: masses by up to 0.04 %, centres by up to 0.25 mm; half: masses by up to 0.02 %, centres by
        up to 0.06 mm.
    """

    weighing_steps: Final = 10
    """[1] Iterations after which noise, blows and weights of runs are fixed: a row that alternates between used
    and excluded would keep changing the gains by 0.01 %.

    Origin: measured on the UR10e.
    Factor of two: twice: masses by up to 0.01 %; half: masses by up to 0.22 %, centres by up to 0.43 mm, intervals
        by +0 to +2 %.
    """

    fresh_steps: Final = 3
    """[1] The same for a fit that starts from the solution of another.

    Origin: cost.
    Factor of two: either way: nothing.
    """

    settled: Final = 0.05
    """[1] Change of all unknowns together, in standard deviations, below which the fit has settled.

    Origin: cost: a twentieth of what the data can tell.
    Factor of two: either way: nothing.
    """

    shortest_step: Final = 0.01
    """[1] Shortest share of a step: full steps of poorly determined unknowns could oscillate across the kink of
    |tau|.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    largest_step: Final = 0.3
    """[1] Largest change of the logarithm of a gain in one iteration.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    least_left: Final = 0.25
    """[1] Least share of the noise that is assumed to be left in the residual: four times as many rows as
    unknowns.

    Origin: prior, not measured.
    Factor of two: twice: masses by up to 0.03 %, centres by up to 0.2 mm, intervals by -1 to +0 %; half: masses by
        up to 0.02 %, centres by up to 0.22 mm.
    """


class GainTest:
    """Gains that a pair contradicts (`contradicted_gains`)."""

    unknown: Final = 1.0
    """[1] Standard deviation of the logarithm of an unknown gain: a factor of e.

    Origin: prior: wide enough not to matter.
    Factor of two: either way: nothing.
    """

    contradicts: Final = 4.0
    """[1] Standard deviations beyond which a gain is contradicted.

    Origin: prior: one more than usual, as residuals are not quite normal.
    Factor of two: twice: masses by up to 0.87 %, centres by up to 0.29 mm, intervals by -3 to +0 %, other notes on
        3 of 4; half: masses by up to 0.87 %, centres by up to 0.29 mm, intervals by -3 to +0 %, other notes on 2 of
        4.
    """

    assumed: Final = 2.0
    """[1] Half width of the assumed range of a gain in standard deviations, 95 %.

    Origin: mathematics.
    Factor of two: twice: masses by up to 0.87 %, centres by up to 0.29 mm, intervals by -3 to +0 %, other notes on
        3 of 4; half: nothing.
    """

    matters: Final = 0.03
    """[1] Error of a gain that is named at the least: the friction of one pair of runs can look like it.

    Origin: measured: on the UR10e 0.962 to 1.037 at one joint.
    Factor of two: twice: masses by up to 0.87 %, centres by up to 0.29 mm, intervals by -3 to +0 %, other notes on
        1 of 4; half: nothing.
    """

    nine_of_ten: Final = 1.28
    """[1] Standard deviations above a threshold at which it is exceeded with a probability of 90 %.

    Origin: mathematics.
    Factor of two: twice: other notes on 2 of 4; half: other notes on 1 of 4.
    """

    suspect: Final = 0.7
    """[1] Share of the smallest error worth naming from which a gain is tried as unknown.

    Origin: cost: with it held, an error hides a part of itself.
    Factor of two: twice: masses by up to 0.87 %, centres by up to 0.29 mm, intervals by -3 to +0 %, other notes on
        1 of 4; half: nothing.
    """

    less: Final = 0.999
    """[1] Greatest share of its prior's variance that a gain keeps.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    poor: Final = 2.0
    """[1] A pair measures a gain poorly if its standard deviation exceeds the assumed one by this factor.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    poorly: Final = 2.0
    """[1] Factor on the threshold of a poorly measured gain, because such a joint's friction looks like a gain
    error.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """


class Payloads:
    """A payload read from a posterior (`payload_from_posterior`)."""

    blind: Final = 0.5
    """[1] Share of the prior's variance that remains in a direction of which the rows say nothing.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """

    lasting: Final = 0.5
    """[1] Part of a joint's residual beyond the calibration's noise that may be proportional to its torque throughout
    the run.

    Origin: measured: on simulated arms with elastic joints and gears of two efficiencies, 69 to 97 % of the intervals
        of single runs hold without it, 96 % or more with it.
    Factor of two: with nominal gains nothing, as it is of calibrated arms.
    """

    noisier: Final = 3.0
    """[1] Noise of the difference of a pair, in units of a calibration's, from which a joint's model is doubted.

    Origin: measured: at most 2.9 on er50, prbt and the UR10e.
    Factor of two: with nominal gains nothing, as it is of calibrated arms.
    """

    negligible: Final = 1e-6
    """[1] Share of a combination's size in undetermined directions below which it is determined.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    asymmetry: Final = 0.6
    """[1] Half the difference of a gear's losses in units of mu^2, one standard deviation.

    Origin: physics: +0.5 with equal efficiencies in both directions, 0 with b = 2 - 1/f, -0.8 with 0.85 and 0.75.
    Factor of two: twice: intervals by +0 to +12 %; half: intervals by -3 to +0 %.
    """


class Elasticity:
    """Gears that give way (`elastic_joints`)."""

    lag_rad: Final = 0.002
    """[rad] Standard deviation of a joint's lag under its RMS torque.

    Origin: prior, not measured: gears of robots give way by 1 to 3 mrad under their rated torque.
    Factor of two: with nominal gains nothing, as it is of calibrated arms. Of a pair of the UR10e, twice: intervals by
        +1 %; half: by -1 %.
    """


class DisturbanceLimits:
    """Zeros of joints, tilts, hoses and forces (`disturbances`).

    Factors of two were tried with er50, prbt and the UR10e, from a pair, a calibrated pair and a single run.
    """

    usual_rad: Final = 5e-4
    """[rad] Standard deviation of a joint's zero, and of a tilt of the base since the other run.

    Origin: prior, not measured: joints are set to their marks to a few hundredths of a degree, and a pedestal bends as
        little.
    Factor of two: twice: intervals of centres by +0 to +10 %; half: by -4 to -0 %.
    """

    usual_n: Final = 0.5
    """[N] Standard deviation of a force that is usual.

    Origin: measured: the vertical force of a pair of the UR10e is 1.7 +- 0.55 N without anything that pulls.
    Factor of two: either way: nothing.
    """

    certain: Final = (3.4, 3.9, 4.2)
    """[1] Standard deviations from which an error is certain, by its number of components.

    Origin: mathematics: by chance, one of 15 disturbances exceeds it in one of a hundred identifications. Measured: 3
        of 315 sound runs of four simulated arms, 7 of 217 with coloured noise or a calibration from two runs.
    Factor of two: half: a note on one of nine sound runs; twice: nothing on sound runs, and smaller disturbances stay
        unnamed (reasoned).
    """

    suspect: Final = 0.6
    """[1] Size relative to that from which it is certain, from which an error is looked for without it in the noise.

    Origin: cost: with it in the noise, an error hides a part of itself.
    Factor of two: either way: nothing on sound runs.
    """

    tried: Final = 3
    """[1] Most errors that are looked for so.

    Origin: cost: a solve each, in one run of ten without any.
    Factor of two: either way: nothing on sound runs.
    """

    worth_rad: Final = 0.005
    """[rad] Least angle that is named, 0.3 deg.

    Origin: prior: it moves the centre of mass of a load at 0.2 m by 1 mm.
    Factor of two: either way: nothing on sound runs.
    """

    worth_n: Final = 2.0
    """[N] Least force that is named.

    Origin: prior: a fifth of a kilogram.
    Factor of two: either way: nothing on sound runs.
    """

    worth_share: Final = 0.01
    """[1] Least torque of a hose that is named, as a share of the joint's RMS torque.

    Origin: prior: less is lost in friction.
    Factor of two: either way: nothing on sound runs.
    """

    most_rad: Final = 0.1
    """[rad] Greatest angle.

    Origin: prior: with more, an arm is seen not to fit its file.
    Factor of two: either way: nothing on sound runs.
    """

    most_n: Final = 1000.0
    """[N] Greatest force.

    Origin: prior: wide enough not to matter.
    Factor of two: either way: nothing.
    """


class Drift:
    """Gains that drift between the two runs of a pair (`run_drift`)."""

    between_runs: Final = 0.001
    """[1] Standard deviation of the drift of all gains together between runs that follow each other.

    Origin: physics: warm magnets lose about 0.1 % of their torque per kelvin. Seven pairs of runs of one day of the
        UR10e most likely show none, and at most 0.25 % (95 %).
    Factor of two: not measured; 0.15 % instead: of calibrated pairs of the UR10e, intervals by +4 to +15 %.
    """

    friction: Final = 0.02
    """[1] Standard deviation of a common change of all friction between these runs.

    Origin: measured: the UR10e's viscous friction within hours (`WITHIN_HOURS`).
    Factor of two: not measured; 1.5 or 3 % instead: the drift that harsh pairs of prbt show by 0.04 %.
    """

    refined: Final = 1.0
    """[1] Standard deviations from which a drift is estimated once more, from where it is corrected.

    Origin: measured: to first order, 1 % of drift of a simulated pair is 0.5 %, 1.4 standard deviations.
    Factor of two: twice: that pair's interval does not hold; half: not measured.
    """

    matters: Final = 0.25
    """[1] Share of the mass's half width from which a usual drift is mentioned where the intervals do not allow for it.

    Origin: prior: the interval would be 11 % wider.
    Factor of two: a note more or less, nothing else.
    """

    noted: Final = 3.0
    """[1] Standard deviations from which a note says so.

    Origin: prior: exceeded by chance in one of 400 pairs.
    Factor of two: either way: nothing, unless gains drift.
    """


class Blows:
    """Blows to an arm (`normal_equations`)."""

    struck: Final = 8.0
    """[1] Standard deviations of a blow; a second joint must exceed half of it, because a blow shakes the entire
    arm while friction at a reversal affects one joint.

    Origin: prior, not measured.
    Factor of two: twice: nothing; half: masses by up to 0.79 %, centres by up to 0.56 mm, intervals by -3 to +0 %,
        other notes on 1 of 4.
    """

    around_s: Final = 0.4
    """[s] Time around a blow that is not used.

    Origin: prior, not measured: an arm rings for some tenths of a second.
    Factor of two: either way: nothing.
    """

    rounding_s: Final = 1e-6
    """[s] Rounding of times.

    Origin: numerics.
    Factor of two: either way: nothing.
    """

    most: Final = 0.10
    """[1] If a greater share of a run is off, the cause is not a blow.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
