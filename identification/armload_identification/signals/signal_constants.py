"""Every number that the processing of signals has chosen, with its origin and what it costs to be wrong.

A class is a concern, an attribute a constant. Its docstring states the unit in brackets ([1]: none) and the meaning,
then

- Origin: physics, a standard, a paper, the measurement that chose it, or "prior, not measured";
- Factor of two: what happens with twice and with half the value. Unless marked as reasoned, this was measured: with
  the tests of signals, and with six identifications, of which the greatest change is given: the UR10e's pairs a and b
  with nominal gains, pair a and its loaded run alone with a calibration from the other runs, and the simulated arm of
  the unit tests with and without whole periods. "Nothing" is less than 0.01 % of the mass, 0.05 mm of the centre of
  mass and 1 % of an interval, with as many notes, and no test fails. Tests are those of then; since, many more turn at
  a number.

Numbers that follow from others are computed from them. Plain arithmetic (a half, a square) is not listed.
"""

from __future__ import annotations

from typing import Final


class SplineFit:
    """The spline of a measured position (`spline`)."""

    degree: Final = 5
    """[1] Degree of the spline: its acceleration is a cubic, with a continuous derivative.

    Origin: mathematics; the lowest odd degree whose acceleration is smooth.
    Factor of two: twice: nothing; half: masses by up to 0.96 %, centres by up to 1.9 mm, intervals by -1 to +81 %,
        other notes on 1 of 6, 1 test fails.
    """
    coarsest_s: Final = 2.0
    """[s] Widest spacing of knots that is tried; it is halved as long as samples allow.

    Origin: prior, not measured: slower motion needs no fewer knots to be fitted well.
    Factor of two: either way: nothing. Reasoned: the finer knots that cross-validation chooses are tried in any case.
    """
    fewest_pieces: Final = 4
    """[1] A run shorter than this many widest spacings is divided into this many pieces at first.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: the finer knots that cross-validation chooses are tried in any case.
    """
    samples_per_knot: Final = 8
    """[1] Samples between knots below which the encoder's noise would appear in the acceleration.

    Origin: prior, not measured; chosen with the first version of the fit.
    Factor of two: twice: masses by up to 0.05 %, centres by up to 0.22 mm, intervals by -1 to +5 %; half: masses by
        up to 0.07 %, centres by up to 0.51 mm, intervals by -2 to +1 %.
    """
    motion_over_noise: Final = 4.0
    """[1] Factor by which knots that are even finer must reduce the squared residual: it is then motion, not noise.

    Origin: measured: noise is reduced by less than 2. Of motion of 0.5 Hz at 12.5 Hz a third of a joint's amplitude was
        left, and the mass was 20 % too low; at 25 Hz, 0.6 %.
    Factor of two: either way: nothing, on the measured runs and on that motion.
    """
    samples_per_coefficient: Final = 2
    """[1] Least samples for each coefficient of the whole spline, and on both sides of each knot.

    Origin: mathematics: one would interpolate the noise.
    Factor of two: either way: nothing. The condition matters for runs of few samples only.
    """
    negligible_rad: Final = 1e-9
    """[rad] Residual of a position, spline or series, below which a finer fit is no better: no encoder resolves it.

    Origin: physics; encoders of 24 bits resolve 4e-7 rad.
    Factor of two: either way: nothing. Residuals of real encoders are far above it.
    """


class RunAlignment:
    """The time between two runs of one motion (`load_signal`)."""

    grid_s: Final = 0.02
    """[s] Spacing of the times at which two runs are compared; the shift itself is continuous.

    Origin: prior, not measured: motion of up to 10 Hz needs 20 samples per second, this is 50.
    Factor of two: either way: nothing.
    """
    fewest_times: Final = 256
    """[1] Least number of these times, for short runs.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
    shortest_s: Final = 1.0
    """[s] Least common motion of two runs.

    Origin: prior, not measured: an excitation's slowest harmonic takes several seconds, so less says nothing.
    Factor of two: either way: nothing. Runs that share so little are refused sooner or later; the tests share more,
        or nothing.
    """
    elsewhere_rad: Final = 0.1
    """[rad] Runs this far apart are not in the same motion at that moment, such as while being jogged to the start.

    Origin: prior, not measured; ten times `SamePath.rms_rad`.
    Factor of two: either way: nothing. The tests' runs are either alike or far apart.
    """
    same_share: Final = 0.5
    """[1] Least share of the common times at which both runs are in the same motion, to leave out the others.

    Origin: prior, not measured: a majority.
    Factor of two: either way: nothing.
    """
    steps: Final = 8
    """[1] Greatest number of Gauss-Newton steps.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
    largest_step_s: Final = 0.5
    """[s] Greatest change of the shift in one step.

    Origin: prior, not measured: the correlation before it is right to a grid interval, unless the motions differ.
    Factor of two: either way: nothing. It matters only where the first value is more than that off.
    """
    settled_s: Final = 1e-9
    """[s] Change of the shift that ends the steps.

    Origin: numerics; at 3 rad/s a joint moves by 3e-9 rad, far less than an encoder resolves.
    Factor of two: either way: nothing.
    """
    phases: Final = 100
    """[1] Phases at which two runs of one excitation are compared; the shift is the median over them.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """


class SamePath:
    """When two runs are of the same motion, so that their torques may be subtracted (`load_signal`)."""

    rms_rad: Final = 0.01
    """[rad] RMS difference of a joint's positions that is always allowed.

    Origin: prior, not measured; the two runs of the UR10e's first pair differ by less than 2e-4.
    Factor of two: either way: nothing. Reasoned: it decides which pairs are accepted; 0.01 rad leaves 1 % of a
        joint's gravity torque in the difference.
    """
    rms_share: Final = 0.03
    """[1] The same as a share of the standard deviation of the joint's position; the greater of both counts.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: as for `rms_rad`.
    """
    period_share: Final = 0.002
    """[1] Greatest relative difference of the durations of one period.

    Origin: inertial torque of the arm, which does not cancel, differs by twice this share. 2 %, as of a wrong clock,
        make 10 kg on er50 29 % too heavy.
    Factor of two: either way: nothing. Reasoned: the error in proportion; stamps that are 10 ms late at one end of a
        period of 5 s are a difference of 0.2 %.
    """
    peak_over_rms: Final = 5.0
    """[1] Greatest difference at any moment of the common part, in multiples of the allowed RMS.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: more or less of the ends of runs that differ there is used.
    """
    common_share: Final = 0.3
    """[1] Least share of the moving time that the common part must have; else the whole is compared.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: short common parts are used, or the pair is refused by its whole
        difference.
    """


class Smoothing:
    """The smoothing of an average period (`filters`)."""

    window: Final = 5
    """[1] Samples of the window.

    Origin: Chen 2016, eq. (8).
    Factor of two: twice: masses by up to 0.01 %, centres by up to 0.04 mm, intervals by -1 to +0 %, 1 test fails;
        half: 1 test fails.
    """
    order: Final = 3
    """[1] Order of the polynomial fitted in the window.

    Origin: Chen 2016, eq. (8).
    Factor of two: twice: 1 test fails; half: masses by up to 0.001 %, centres by up to 1.1 mm, intervals by +0 to
        +68 %, 1 test fails.
    """
    passes: Final = 5
    """[1] Passes of the filter.

    Origin: Chen 2016.
    Factor of two: either way: 1 test fails.
    """
    loss_limit: Final = 0.10
    """[1] Share of a signal's RMS that smoothing may remove without a note.

    Origin: Chen 2016.
    Factor of two: either way: nothing. Reasoned: notes on half or twice the loss; no result changes.
    """


class LowPass:
    """The zero-phase low-pass of a torque without periods (`filters`, `motion`)."""

    order: Final = 4
    """[1] Order of the Butterworth filter, applied forwards and backwards.

    Origin: convention; its edge is steep enough beside a band eight times narrower.
    Factor of two: twice: 4 tests fail; half: masses by up to 0.01 %, centres by up to 0.06 mm, 4 tests fail.
    """
    fast_from: Final = 16384
    """[1] Rows from which on a grid ends where its Fourier transforms are fast, up to one row in a hundred earlier.

    Origin: cost: a pair of 1.5 million rows, reduced to 75,000 of an unlucky number, took 24 s, one of 3 million 5 s.
    Factor of two: twice or half: nothing but time.
    """
    bands: Final = 8.0
    """[1] Cutoff in multiples of the motion's band.

    Origin: prior, not measured: the torque of a motion contains products of its frequencies, and friction.
    Factor of two: twice: masses by up to 0.07 %, centres by up to 0.56 mm, intervals by -4 to +3 %; half: masses by
        up to 0.09 %, centres by up to 0.53 mm, intervals by -2 to +1 %, other notes on 1 of 6.
    """
    band_power: Final = 0.999
    """[1] Share of the velocities' power that lies within the motion's band.

    Origin: prior, not measured.
    Factor of two: half: masses by up to 0.09 %, centres by up to 0.53 mm, other notes on 1 of 6, as `bands` halved.
        Twice is above 1; half the rest, 0.9995, reasoned: as little as `lowest_hz` doubled.
    """
    lowest_hz: Final = 2.0
    """[Hz] Lowest cutoff.

    Origin: prior, not measured: friction at reversals needs this much even in the slowest motion.
    Factor of two: twice: masses by up to 0.05 %, centres by up to 0.37 mm, intervals by -2 to +1 %; half: nothing.
    """
    highest_of_rate: Final = 0.25
    """[1] Highest cutoff as a share of the sampling rate.

    Origin: half of Nyquist's frequency.
    Factor of two: either way: nothing.
    """
    padding: Final = 3.0
    """[1] Length of each extended end in periods of the cutoff frequency.

    Origin: prior, not measured; the ends then agree with `scipy.signal.sosfiltfilt` to 1e-8 of the torque of a recorded
        motion.
    Factor of two: either way: nothing. Only the ends of a run see it.
    """
    hole: Final = 0.25
    """[1] Distance of samples, in periods of the cutoff frequency, above which what lies between them is a gap.

    Origin: sampling; four samples per period of the highest frequency that passes.
    Factor of two: twice: 1 test fails; half: nothing.
    """
    uneven: Final = 1.5
    """[1] Distance of samples, in their usual one, up to which none is missing.

    Origin: mathematics; halfway to one that is missing.
    Factor of two: twice: nothing; half: 1 test fails: fast motion at 50 Hz loses samples to rounding of their stamps.
    """


class SampleNoise:
    """Noise of single samples (`filters`, `robust_scale`)."""

    third_difference_gain: Final = 20.0
    """[1] Variance of a third difference of unit white noise, 1 + 9 + 9 + 1.

    Origin: mathematics, the sum of the squared binomial coefficients.
    Factor of two: either way: 6 tests fail. Not a choice.
    """
    median_of_normal: Final = 0.6744897501960817
    """[1] Median of the absolute value of a standard normal variable, its quantile of 3/4.

    Origin: mathematics; a literal, as the module `statistics` takes 7 ms to load, and a test compares the two.
    Factor of two: twice: masses by up to 0.09 %, centres by up to 0.11 mm, intervals by -8 to +5 %, 6 tests fail;
        half: masses by up to 0.01 %, centres by up to 0.04 mm, intervals by -0 to +2 %, 6 tests fail. Not a choice.
    """


class NominalGain:
    """Gains that were not calibrated (`joint_torque`)."""

    deviation: Final = 0.02
    """[1] Relative standard deviation of a gain before calibration.

    Origin: prior; on the UR10e, gains from a regression of the controller's own signals, off by up to 4.8 %, cause
        errors of the mass of 0.2 to 3 %.
    Factor of two: twice: masses by up to 1.4 %, centres by up to 1.5 mm, intervals by +0 to +55 %, other notes on 4
        of 6; half: masses by up to 0.85 %, centres by up to 4.4 mm, intervals by -25 to +5 %. The masses of the
        UR10e are then 0.3 to 0.5 % high, or 0.7 to 1.7 % low, inside their intervals.
    """

    common_deviation: Final = 0.008
    """[1] Relative standard deviation of an error that all gains have in common.

    Origin: physics: per kelvin, magnets lose 0.04 (samarium) to 0.12 % (neodymium) of their torque, and motors are 10 K
        from the catalogue's temperature. Only a known mass reveals it.
    Factor of two: twice: half widths of masses from nominal gains by up to +30 %; half: by up to -12 % (reasoned).
    """


class ReportedTorque:
    """Torque that drives or joint sensors report (`joint_torque`); a joint's own error is that of a nominal gain."""

    common_deviation: Final = 0.02
    """[1] Relative standard deviation of an error that all joints' torques have in common.

    Origin: prior: drives compute torque (6077) from the current with a rated torque (6076) of two digits, and with one
        temperature model for all joints. No recording shows it.
    Factor of two: twice: half widths of masses from reported torque by +70 %; half: by -40 % (reasoned).
    """

    same_quantity: Final = 1.0
    """[1] Logarithm of the greatest ratio of two gains of the same quantity.

    Origin: prior: gains of reported torque are about 1, axis torques per ampere of arms 10 to 200.
    Factor of two: either way: nothing (reasoned).
    """


class Standstill:
    """Joints and runs at rest (`reversals`, `repetition`, `motion`)."""

    travel_rad: Final = 0.01
    """[rad] Travel above which a joint moves.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: joints that sway by this much count as moving, and their static
        friction as payload (3 kg were found as 9.3 kg); or a joint that moves little is left out.
    """
    share_of_peak_speed: Final = 0.02
    """[1] Share of the arm's greatest speed from which it counts as moving; standstill at both ends is cut off.

    Origin: prior, not measured.
    Factor of two: twice: masses by up to 0.02 %, centres by up to 0.06 mm, other notes on 1 of 6; half: nothing.
    """
    slowest_rad_s: Final = 1e-4
    """[rad/s] Least greatest speed of a joint to which shares refer, against division by zero.

    Origin: numerics.
    Factor of two: either way: nothing. No joint that moves is that slow.
    """
    samples_over_rows: Final = 10
    """[1] Greatest ratio of equidistant samples to rows of a run: beyond it, most of the motion is missing.

    Origin: prior, not measured; bounds the memory that a damaged time column takes.
    Factor of two: either way: nothing. Reasoned: memory for damaged files changes in proportion.
    """


class Reversal:
    """Reversals of a joint (`reversals`)."""

    direction_share: Final = 0.01
    """[1] Speed that smooths the direction of motion, as a share of a joint's greatest speed.

    Origin: prior, not measured.
    Factor of two: twice: masses by up to 0.15 %, centres by up to 0.13 mm, intervals by -5 to +1 %, other notes on
        1 of 6; half: masses by up to 0.06 %, centres by up to 0.22 mm, intervals by -0 to +7 %, other notes on 1 of
        6.
    """
    weight_share: Final = 0.10
    """[1] Share of a joint's greatest speed at which a sample's weight is 0.7.

    Origin: a servo settles within 50 ms of a reversal; on er50's motions a tenth excludes this time, and rotors, load
        friction and delay are identified within 2 %.
    Factor of two: twice: masses by up to 0.38 %, centres by up to 1.9 mm, intervals by -3 to +21 %, other notes on
        1 of 6, 1 test fails; half: masses by up to 0.13 %, centres by up to 2.8 mm, intervals by -9 to +3 %, other
        notes on 1 of 6.
    """


class PeriodSeries:
    """Folding onto one period, and the Fourier series of its motion (`periods`)."""

    coefficients_per_sample: Final = 0.25
    """[1] Greatest ratio of the series' coefficients to samples.

    Origin: prior, not measured; leaves three quarters of the samples to judge a series by.
    Factor of two: either way: nothing.
    """
    at_low_rates_hz: Final = 6.25
    """[Hz] Frequency up to which the series may reach in any case: what an arm does up to there belongs to its motion.

    Origin: what `coefficients_per_sample` gives at 50 samples per second; runs of 20 to 50 are fitted up to 4 to 6 Hz.
    Factor of two: twice: nothing; half: 1 test fails.
    """
    coefficients_at_low_rates: Final = 0.45
    """[1] Greatest ratio of coefficients to samples where the first one would end the series below that frequency.

    Origin: mathematics; a series with as many coefficients as samples, 0.5 for sines and cosines each, fits noise.
    Factor of two: twice: nothing; half: 1 test fails.
    """
    fillings: Final = 20
    """[1] Iterations that fill empty phases from the series.

    Origin: prior, not measured.
    Factor of two: either way: nothing. Reasoned: phases without any sample in all periods are rare.
    """
    least_freedom: Final = 0.01
    """[1] Least share of the samples beyond the coefficients in the score of a series, against log 0.

    Origin: numerics.
    Factor of two: either way: nothing.
    """
    neighbours: Final = 1.5
    """[1] Greatest distance, in sampling intervals, of two samples between which a phase is interpolated.

    Origin: sampling; a lost sample makes it 2, jitter some per cent more than 1.
    Factor of two: twice: nothing; half: 1 test fails. Reasoned: twice bridges two lost samples; half takes jitter
        for lost samples.
    """
    rounding: Final = 1e-9
    """[1] What the distance may exceed this by, in sampling intervals: stamps of 2 and 3 ms are 1.5 intervals apart.

    Origin: numerics.
    Factor of two: either way: nothing. Far above rounding, far below jitter.
    """
    beyond_the_last: Final = 0.5
    """[1] Time after the last sample, in sampling intervals, at which a phase still belongs to it.

    Origin: rounding to the nearest sample.
    Factor of two: either way: nothing.
    """
    memory_s: Final = 2.0
    """[s] Lag to which the autocorrelation of the noise between periods is taken, fading to 0.

    Origin: statistics: of 40 s of seven joints it determines the variance of long means within 7 %.
    Factor of two: with noise that is slow for 0.3 s, twice: intervals by -1 to +2 %; half: by -4 to +2 %.
    """


class Repetition:
    """A motion that repeats (`repetition`)."""

    alike: Final = 0.998
    """[1] Normalised square difference function (1 for equal motions) from which a motion counts as repeated.

    Origin: prior, not measured: 0.998 is an RMS difference of 6 % of the motion's standard deviation.
    Factor of two: half: nothing. Twice is above 1. Reasoned: of what is missing to 1, twice takes motions for the
        same that differ by 9 % RMS; half leaves out real repetitions whose encoders or servos scatter.
    """
    unlike: Final = 0.5
    """[1] Value below which the motion has left its start, so that a later peak is a return.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
    fewest_samples: Final = 16
    """[1] Samples below which no period is looked for.

    Origin: prior, not measured.
    Factor of two: either way: nothing.
    """
    most_samples: Final = 32768
    """[1] Samples to which a run is thinned; the period is interpolated between them.

    Origin: prior, not measured: an hour at 9 Hz.
    Factor of two: either way: nothing. Reasoned: time and memory of the transform in proportion.
    """


class RowMean:
    """Means over a window, the rows of a run of any motion (`arm_rows`)."""

    half_s: Final = 0.16
    """[s] Half the length of the window.

    Origin: simulated arms with elastic joints: 10 kg identified as 10.6 kg without a window for the model, 10.1 kg
        with it; settling after a reversal takes 0.1 s.
    Factor of two: twice: masses by up to 0.01 %, centres by up to 0.13 mm, intervals by -5 to +10 %, 1 test fails;
        half: masses by up to 0.1 %, centres by up to 0.32 mm, intervals by -1 to +31 %.
    """
    onward: Final = 0.95
    """[1] Mean direction over the window from which a joint's row has a weight.

    Origin: prior, not measured.
    Factor of two: half: intervals by up to 1 %. Twice is above 1. Reasoned: of what is missing to 1, twice lets
        rows into the fit in whose window a joint turns for a twentieth of the time; half leaves out rows with noise
        in the direction.
    """
