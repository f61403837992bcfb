"""The paper's Table 2 and Table 3 with additional columns for this program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters, derived
from benchmarks.arms.trials import Trial
from benchmarks.paper import published
from benchmarks.results.bound import paper_deviation, paper_values
from benchmarks.results.error_statistics import Errors


def print_table_2(
    trials: Sequence[Trial], truth: InertialParameters, covariance: FloatArray, criterion: str
) -> tuple[FloatArray, FloatArray]:
    """Table 2: truth, the paper's column, ours and the bound.

    Args:
        trials: Seeds of one setup.
        truth: The true payload in frame 3.
        covariance: Bound of theta.
        criterion: Compared quantity, printed below the table.

    Returns:
        (10,) ratio of the RMS error to the bound, and (10,) median error in per cent.
    """
    errors = Errors.of(trials, truth)
    one = next(trial for trial in trials if not trial.refused)
    true, ours = paper_values(truth), paper_values(one.parameters)
    bound = 100.0 * paper_deviation(truth, covariance) / np.abs(true)
    rms = 100.0 * np.sqrt(np.mean(errors.paper_share**2, axis=0))
    middle = 100.0 * np.median(np.abs(errors.paper_share), axis=0)
    print(
        "  parameter      |    truth |   paper's  error % |  ours, seed "
        f"{one.seed}  error % | {len(errors.mass_share)} seeds: median %   RMS % | bound % | RMS/bound"
    )
    for i, name in enumerate(published.NAMES):
        print(
            f"  {name:5s}{published.UNITS[i]:>9s} | {true[i]:8.3f} | {published.ESTIMATE[i]:9.3f} "
            f"{published.ERROR_PERCENT[i]:8.1f} | {ours[i]:13.4f} {abs(ours[i] / true[i] - 1) * 100:8.2f} | "
            f"{middle[i]:18.2f} {rms[i]:7.2f} | {bound[i]:7.2f} | {rms[i] / bound[i]:9.2f}"
        )
    print(f"  (compared below: {criterion}; inertia about frame 3's origin, products +integral, as in the paper)")
    return rms / bound, middle


def print_table_3(trials: Sequence[Trial]) -> None:
    """Table 3: residual and noise per joint; this program's, for the difference of two runs, are sqrt(2) larger."""
    done = [trial for trial in trials if not trial.refused]
    residual = np.sqrt(np.mean([trial.residual_nm**2 for trial in done], axis=0))
    noise = np.sqrt(np.mean([trial.noise_nm**2 for trial in done], axis=0))
    print("  joint | paper: RMS1    RMS2  ratio | ours, one run: RMS1    RMS2  ratio | difference: RMS1    RMS2  (N m)")
    for i in range(published.NOISE_NM.size):
        paper = published.RESIDUAL_NM[i] / published.NOISE_NM[i]
        print(
            f"  {i + 1:5d} | {published.RESIDUAL_NM[i]:11.3f} {published.NOISE_NM[i]:7.3f} {paper:6.2f} | "
            f"{residual[i] / np.sqrt(2):19.3f} {noise[i] / np.sqrt(2):7.3f} {residual[i] / noise[i]:6.3f} | "
            f"{residual[i]:16.3f} {noise[i]:7.3f}"
        )


def print_values(trials: Sequence[Trial], truth: InertialParameters, covariance: FloatArray) -> None:
    """The ten values of a payload file: truth, errors, bound, coverage, share of seeds in which they are determined."""
    errors = Errors.of(trials, truth)
    middle = np.median(np.abs(errors.value_errors), axis=0)
    rms = np.sqrt(np.mean(errors.value_errors**2, axis=0))
    determined, inside = errors.determined.mean(axis=0), errors.inside.mean(axis=0)
    half = np.median([trial.half_width_95 for trial in trials if not trial.refused], axis=0)
    bound = value_deviation(truth, covariance)
    print("  value  |      truth | median error  RMS error      bound | interval +-  holds truth | determined")
    for i, name in enumerate(PARAMETER_NAMES):
        print(
            f"  {name:6s} | {truth.values[i]:10.5f} | {middle[i]:12.5f} {rms[i]:10.5f} {bound[i]:10.5f} | "
            f"{half[i]:11.5f} {inside[i]:11.0%} | {determined[i]:10.0%}"
        )


def value_deviation(body: InertialParameters, covariance: FloatArray) -> FloatArray:
    """(10,) standard deviations of mass, centre of mass and inertia about it."""
    _, slope = derived(body)
    return np.asarray(np.sqrt(np.einsum("ki,ij,kj->k", slope, covariance, slope)))
