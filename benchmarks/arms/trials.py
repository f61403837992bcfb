"""Many seeded commissionings of one setup, spread over the cores.

A trial is one seed: an unloaded and a loaded recording of the setup's steady periods with noise, quantisation and
gain errors of that seed, identified through the public `identify`. Its random numbers depend only on the seed and the
setup's name, never on the order or the number of processes.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.files.payload_file import format_payload, parse_payload
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError, PayloadFileError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters, Provenance
from armload_identification.pipeline.identification_result import Identification, payload_result
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from benchmarks.arms.calibrated import calibrated_from_pair, identified_with
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import SteadyPeriod

_SEEDS_PER_TASK = 5


@dataclass(frozen=True, eq=False)
class CalibrationLoad:
    """A second, weighed payload that the arm is calibrated with before the payload is identified.

    Attributes:
        loaded: Steady period with it.
        truth: Its ten parameters in the flange frame of the setup's chain, all of them known.
    """

    loaded: SteadyPeriod
    truth: InertialParameters


@dataclass(frozen=True, eq=False)
class Setup:
    """An arm, its excitation and its payload, ready to be recorded with a seed.

    Attributes:
        name: Printed, and part of every seed.
        loaded: Steady period with the payload.
        unloaded: Steady period without.
        scales: Units and noise of the drives.
        chain: The arm; its flange is the frame of the result.
        transmission: Gains, marked as calibrated if they are exact and as nominal if not, and coupling.
        truth: The payload in the chain's flange frame.
        periods: M of each run.
        gain_spread: Gain errors are uniform within this share, one per axis and seed.
        noise_scale: Factor on noise and quantisation of the torque.
        calibration: Payload that the arm is calibrated with; None for no calibration.
    """

    name: str
    loaded: SteadyPeriod
    unloaded: SteadyPeriod
    scales: DriveScales
    chain: Chain
    transmission: Transmission
    truth: InertialParameters
    periods: int
    gain_spread: float = 0.0
    noise_scale: float = 1.0
    calibration: CalibrationLoad | None = None

    def rng(self, seed: int) -> np.random.Generator:
        """The random numbers of a seed."""
        return np.random.default_rng([zlib.crc32(self.name.encode()), seed])

    def without_noise(self) -> Setup:
        """Noise and quantisation times 0.001: the weights keep their ratios and only model errors remain."""
        return replace(self.with_gains(0.0), name=f"{self.name}, without noise", noise_scale=1e-3)

    def with_gains(self, spread: float) -> Setup:
        """Nominal gains with errors uniform within a spread; with 0 they are exact and marked as calibrated."""
        exact = np.full(self.scales.n, spread == 0.0)
        transmission = Transmission(self.transmission.gain_nm_a, self.transmission.coupling, exact)
        return replace(self, gain_spread=spread, transmission=transmission)


@dataclass(frozen=True, eq=False)
class Trial:
    """The result of one seed.

    Attributes:
        seed: The seed.
        refused: Why there is no result; empty if there is one.
        theta: (10,) of the reported estimate; NaN if refused, like all below except `determined`, which is then False.
        half_width_95: (10,) of mass, centre of mass and inertia about it.
        determined: (10,) likewise.
        margin: Smallest eigenvalue of the pseudo-inertia over its trace, after reading the payload's file back;
            -inf if the file is refused.
        residual_nm: (n,) RMS of raw single-sample differences minus prediction.
        noise_nm: (n,) noise of one such difference.
    """

    seed: int
    refused: str
    theta: FloatArray
    half_width_95: FloatArray
    determined: NDArray[np.bool_]
    margin: float
    residual_nm: FloatArray
    noise_nm: FloatArray

    @property
    def parameters(self) -> InertialParameters:
        """The estimate."""
        return InertialParameters(self.theta)


def pair(setup: Setup, seed: int) -> tuple[Recording, Recording, ArmCalibration | None]:
    """Loaded and unloaded recording of a seed, and the arm's calibration if the setup has one.

    Raises:
        IdentificationError: the arm cannot be calibrated.
    """
    rng = setup.rng(seed)
    gain_error = setup.gain_spread * rng.uniform(-1.0, 1.0, setup.scales.n)

    def run(period: SteadyPeriod) -> Recording:
        return record(period, setup.scales, setup.periods, rng, gain_error, setup.noise_scale)

    calibration = None
    if setup.calibration is not None:
        truth = setup.calibration.truth
        heavy, empty = run(setup.calibration.loaded), run(setup.unloaded)
        known = WeighedPayload(truth.mass_kg, truth)
        calibration = calibrated_from_pair(heavy, empty, known, setup.chain, setup.transmission)
    return run(setup.loaded), run(setup.unloaded), calibration


def identified(setup: Setup, seed: int) -> Identification:
    """The identification of one seed.

    Raises:
        IdentificationError: the pair was refused.
    """
    loaded, unloaded, calibration = pair(setup, seed)
    return identified_with(calibration, loaded, unloaded, setup.chain, setup.transmission)


def trial(setup: Setup, seed: int) -> Trial:
    """Result of one seed; a refusal is a result too."""
    try:
        result = identified(setup, seed)
    except IdentificationError as error:
        nothing = np.full(10, np.nan)
        none = np.full(setup.scales.n, np.nan)
        return Trial(seed, str(error), nothing, nothing, np.zeros(10, dtype=bool), np.nan, none, none)
    return Trial(
        seed=seed,
        refused="",
        theta=result.parameters.theta,
        half_width_95=result.uncertainty.half_width_95,
        determined=result.uncertainty.determined,
        margin=_margin_in_file(result),
        residual_nm=result.residual_rms_nm,
        noise_nm=result.signal.noise_nm,
    )


@contextmanager
def workers() -> Iterator[Executor]:
    """One process per core, each with one thread: the matrices are too small for several."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        yield pool


def run_trials(pool: Executor, setup: Setup, seeds: int, progress: Callable[[int], None]) -> list[Trial]:
    """Seeds 0 to `seeds` - 1 of a setup, in order.

    Args:
        pool: From `workers`.
        setup: What to run.
        seeds: How many.
        progress: Called with the number of seeds that are done.
    """
    trials: list[Trial] = []
    starts = range(0, seeds, _SEEDS_PER_TASK)
    tasks = [pool.submit(_some, setup, range(start, min(start + _SEEDS_PER_TASK, seeds))) for start in starts]
    for task in tasks:
        trials.extend(task.result())
        progress(len(trials))
    return trials


def _margin_in_file(result: Identification) -> float:
    """Margin of the payload after a round trip through its file."""
    try:
        return parse_payload(format_payload(payload_result(result, Provenance("benchmark", "0" * 64, {})))).model.margin
    except PayloadFileError:
        return -np.inf


def _some(setup: Setup, seeds: Sequence[int]) -> list[Trial]:
    return [trial(setup, seed) for seed in seeds]
