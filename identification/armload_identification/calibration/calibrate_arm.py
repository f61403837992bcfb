"""Calibrate an arm from all its runs: use all valid runs, fit, exclude contradicting ones, and report them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.calibration.calibration_constants import Calibrating, Contradiction, OtherMounting
from armload_identification.calibration.calibration_result import (
    ArmCalibration,
    CalibratedPayload,
    CalibratedRun,
    kinematics_sha256,
)
from armload_identification.calibration.mounted_runs import WEIGHED_WITHIN, ArmRuns, MountedRun
from armload_identification.calibration.mounting_mistakes import (
    MountedDifferently,
    Turn,
    most_trials,
    refuse_other_mounting,
)
from armload_identification.calibration.other_motions import doubtful_share
from armload_identification.calibration.run_contradictions import ArmKnowledge, explain
from armload_identification.estimation.arm_from_posterior import identified_body
from armload_identification.estimation.arm_rows import NO_ROWS, ArmLayout, motion_with_rows, row_window
from armload_identification.estimation.arm_terms import (
    CHANGES,
    FRICTION_CHANGE,
    GAIN,
    PAYLOAD,
    TILT,
    TILT_DEVIATION_RAD,
    arm_terms,
    effort_level,
    friction_change,
    places_of,
)
from armload_identification.estimation.elastic_joints import elastic_torque
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError, IdentificationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import Provenance
from armload_identification.model.regressor import PARAMETERS
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_start import run_start_text
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import Motion
from armload_identification.signals.reversals import TURN_OVER
from armload_identification.verdict.joint_words import numbered_joints, remarked_joints
from armload_identification.verdict.recording_checks.column_mistakes import exchanged_columns
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

HALVES: Final = 1.25
"""Factor on the standard deviations of a calibration: what no term describes differs between motions. Without it, ten
halves of all shared runs of the UR10e differ by an rms z of 0.9 (gains), 1.1 (links) and 1.9 (rotors and friction)."""

Progress = Callable[[int, int], None]


def calibrate_arm(
    runs: ArmRuns,
    chain: Chain,
    transmission: Transmission,
    *,
    robot: str,
    made: Provenance,
    progress: Progress | None = None,
) -> ArmCalibration:
    """Calibrate an arm.

    Args:
        runs: All runs, of any motions, days and payloads.
        transmission: Nominal gains, and coupling.
        robot: Its name.
        made: Version of the program, and hash of the robot's configuration.
        progress: Called with the steps done and their total.

    Returns:
        The calibration; runs that are unusable or contradict the others are excluded and named in it.

    Raises:
        EstimationError: no usable run, too few rows, an arm that is mounted differently from its configuration, or no
            convergence.

    References:
        Chen 2016, eqs. (1) to (3), with load-dependent friction, for all runs at once.
    """
    with threadpool_limits(1):
        return _Calibration(runs, chain, transmission, progress).result(robot, made)


@dataclass(frozen=True, eq=False)
class _UsedRun:
    """A run that is used, and its name: the file's, with enough folders to be unique."""

    name: str
    given: MountedRun
    motion: Motion
    rows: RunRows


class _Calibration:
    """The runs that are used, and the excluded ones."""

    def __init__(self, given: ArmRuns, chain: Chain, transmission: Transmission, progress: Progress | None) -> None:
        self._chain, self._transmission, self._weighed = chain, transmission, given.weighed
        self._left_out, self._progress = list(given.left_out), progress or (lambda done, total: None)
        self._before_fit = 2 * len(given.runs) + most_trials(chain)
        self._total = self._before_fit + (len(given.runs) if len(given.runs) <= Calibrating.few else 1)
        self._done = 0
        readable: list[tuple[str, MountedRun, Motion]] = []
        names = _distinct([run.recording.source.path for run in given.runs])
        for name, run in zip(names, given.runs, strict=True):
            motion = self._read(name, run.recording)
            readable += [] if motion is None else [(name, run, motion)]
            self._advance()
        of_torque = {name for name, run, _ in readable if run.recording.torque_nm is not None}
        self._from_torque = 2 * len(of_torque) > len(readable)
        kept, other = ("torque", "current") if self._from_torque else ("current", "torque")
        reason = f"it contains {other}, most runs contain {kept}; calibrate the two separately"
        self._left_out += [(name, reason) for name, *_ in readable if (name in of_torque) is not self._from_torque]
        alike = [run for run in readable if (run[0] in of_torque) is self._from_torque]
        if not alike:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in self._left_out) or "no recording was given"
            raise EstimationError(f"no recording can be used ({reasons.rstrip('.')}).")
        self._layout = ArmLayout.of([motion for _, _, motion in alike], chain, transmission.coupling)
        self._moves = self._layout.peak_rad_s > Calibrating.unmoved_rad_s
        self._used: list[_UsedRun] = []
        for name, run, motion in alike:
            rows = RunRows(self._layout.rows(motion, loaded=bool(run.mounting)), run.mounting)
            self._used.append(_UsedRun(name, run, motion, rows))
            self._advance()

    def result(self, robot: str, made: Provenance) -> ArmCalibration:
        """Fit until no run contradicts the others."""
        self._refuse_too_little()
        self._refuse_other_units()
        try:
            self._refuse_other_mounting()
        except MountedDifferently as mistake:
            # One wrong run of few may look like an inverted joint of all, which then fits little better than before.
            fits = mistake.residual_share < OtherMounting.little or len(self._used) < 3
            without = None if fits else self._without_worst(self._fitted(self._used))
            if without is None or self._noise_share(without).max() > Calibrating.unexplained:
                if not fits:
                    self._refuse_other_columns()
                raise
            self._refuse_other_mounting()
            fit = without
        else:
            fit = self._fitted(self._used)
        self._done = max(self._done, self._before_fit)
        self._progress(self._done, self._total)
        while without := self._without_worst(fit):
            fit = without
        self._progress(self._total, self._total)
        if self._noise_share(fit).max() > Calibrating.unexplained:
            self._refuse_other_columns()
        warnings = [*self._noise_warnings(fit), *self._mass_warnings(fit), *self._friction_warnings(fit)]
        hashes = {run.name: run.given.recording.source.sha256 for run in self._used}
        found = self._named(fit, warnings, robot, replace(made, recordings_sha256=hashes))
        return replace(found, warnings=(*found.warnings, *self._motion_warnings(found)))

    def _without_worst(self, fit: Posterior) -> Posterior | None:
        """Exclude the run that contradicts the others: their fit without it; None if there is none.

        Few runs fit a compromise, from which the wrong one is no farther than the others: then each is tried.
        """
        off = np.array([fit.deviates(index) for index in range(len(fit.groups))])
        few = len(off) <= Calibrating.few
        if off.max() < Calibrating.suspect and not (few and self._hides_one(fit)):
            return None
        tried = []
        for index in np.argsort(-off.max(axis=1)).tolist()[: None if few else 1]:
            others = [run for place, run in enumerate(self._used) if place != index]
            rows, least = self._rows_and_least(others)
            # The rest of a short pair fits whatever it is, so that nothing contradicts it.
            if others and rows >= least:
                without = self._fitted(others)
                tried.append((float((fit.noise_nm / without.noise_nm).max()), index, without))
        if not tried:
            return None
        quietest = max(tried, key=lambda trial: trial[0])
        others_quieter = [trial[0] for trial in tried if trial is not quietest]
        clear = quietest[0] >= Calibrating.quieter * max([1.0, *others_quieter])
        _, index, without = quietest if clear else tried[0]
        if not clear and off[index].max() < Contradiction.contradicts:
            return None
        gross = bool((off[index] * self._noise_share(fit)).max() >= Contradiction.gross)
        reason = self._reason(self._used[index], without, among_all=float(off[index].max()), gross=gross)
        if reason is None:
            return None
        self._left_out.append((self._used.pop(index).name, f"it contradicts the other runs: {reason}"))
        return without

    def _hides_one(self, fit: Posterior) -> bool:
        """Whether any run may make the others quieter by not counting: by a few steps from the fit of all."""
        for index, group in enumerate(fit.problem.groups):
            silent = group.changed(lambda rows: rows.weighted(np.zeros(self._chain.n)))
            groups = [*fit.problem.groups[:index], silent, *fit.problem.groups[index + 1 :]]
            without = solve(replace(fit.problem, groups=groups), rough=True, start=fit, steps=Solver.fresh_steps)
            self._advance()
            if (fit.noise_nm / without.noise_nm).max() >= Calibrating.perhaps:
                return True
        return False

    def _noise_share(self, fit: Posterior) -> FloatArray:
        """(n,) noise of each joint as a share of its torque; 0 for a joint that moves in no run."""
        return np.where(self._moves, fit.noise_nm[0] / fit.problem.noise.greatest_nm, 0.0)

    def _advance(self) -> None:
        self._done = min(self._done + 1, self._total)
        self._progress(self._done, self._total)

    def _read(self, name: str, recording: Recording) -> Motion | None:
        """The motion of a run; None, with the reason recorded, if it cannot be used."""
        path = recording.source.path
        try:
            motion = motion_with_rows(usable_runs([recording], self._chain.n, self._transmission)[0])
            if not row_window(motion).middle.size:
                raise RecordingError(f"{path}: {NO_ROWS}")
        except IdentificationError as problem:
            self._left_out.append((name, str(problem).removeprefix(f"{path}: ")))
            return None
        return motion

    def _fitted(self, runs: Sequence[_UsedRun]) -> Posterior:
        """Fit some of the runs."""
        return solve(self._problem([run.rows for run in runs], self._layout))

    def _problem(self, runs: Sequence[RunRows], layout: ArmLayout) -> Problem:
        """All unknowns of the arm and of some of its runs."""
        rows, mountings = [run.rows for run in runs], {run.mounting for run in runs}
        level = effort_level(rows)
        return Problem(
            terms=[*arm_terms(rows, layout), friction_change(level, layout.peak_rad_s)],
            groups=[Group((run,)) for run in runs],
            noise=Noise.unknown(level),
            coupling=self._transmission.coupling,
            known=[payload.known(name) for name, payload in self._weighed.items() if name in mountings],
        )

    def _refuse_too_little(self) -> None:
        """Raise if there are too few rows for the unknowns: any arm would fit them."""
        rows, least = self._rows_and_least(self._used)
        if rows < least:
            raise EstimationError(
                f"the runs are too short to calibrate the arm: {rows} independent rows of joints in motion for "
                f"{least // Calibrating.rows_per_unknown} unknowns, at least {least} are required. Use longer "
                "excitations, or more runs."
            )

    def _rows_and_least(self, runs: Sequence[_UsedRun]) -> tuple[int, int]:
        """Number of rows of moving joints of some runs, and the least number from which an arm can be fitted."""
        rows = sum(int(np.count_nonzero(run.rows.rows.weight > Solver.moving)) for run in runs)
        payloads = PARAMETERS * len({run.given.mounting for run in runs} - {""})
        arm = places_of(self._layout.base)[TILT].stop
        return rows, Calibrating.rows_per_unknown * (arm + payloads + CHANGES * self._chain.n * len(runs))

    def _refuse_other_mounting(self) -> None:
        """Raise if the runs show another mounting or an inverted joint."""
        # Loaded runs first: the sign of their payload's weight is known.
        tried = sorted(self._used, key=lambda run: not run.given.mounting)[: Calibrating.tried_runs]

        def shares(chain: Chain, turned: Turn) -> FloatArray:
            layout, rows = replace(self._layout, chain=chain), []
            for run in tried:
                motion, mounting = turned(run.motion), run.given.mounting
                window = row_window(motion, spacing=Calibrating.tried_spacing)
                rows.append(RunRows(layout.rows(motion, loaded=bool(mounting), window=window), mounting))
            fit = solve(self._problem(rows, layout), rough=True)
            self._advance()
            # A joint at rest has no explained torque, and its sign does not matter.
            return np.asarray(np.log(np.maximum(self._noise_share(fit)[self._moves], 1e-9)))

        refuse_other_mounting(shares, self._chain, self._transmission.coupling, self._moves)

    def _refuse_other_columns(self) -> None:
        """Raise if a run's columns are those of another joint or direction, or its arm is mounted differently."""
        for run in self._used:
            if exchange := exchanged_columns(run.motion, self._chain, self._transmission.coupling):
                raise EstimationError(f"{run.name}: {exchange.said}")

    def _reason(self, run: _UsedRun, fit: Posterior, *, among_all: float, gross: bool) -> str | None:
        """What is wrong with a run beside the others' fit."""
        arm, mounting = ArmKnowledge(fit, self._layout), run.given.mounting
        said = self._weighed.get(mounting)
        mass_kg = None if said is None else said.mass_kg
        return explain(arm, run.motion, mounting, mass_kg, among_all=among_all, gross=gross)

    def _refuse_other_units(self) -> None:
        """Raise if no joint could carry any of the masses; beside a right one, the run of a wrong one is left out."""
        weighed = [run for run in self._used if run.given.mounting in self._weighed]
        lever_n_m_kg = Calibrating.lever_m * float(np.linalg.norm(self._chain.gravity_m_s2))
        least_nm = [self._weighed[run.given.mounting].mass_kg * lever_n_m_kg for run in weighed]
        greatest_nm = [float(np.abs(run.rows.rows.effort_nm).max()) for run in weighed]
        if weighed and all(np.greater(least_nm, greatest_nm)):
            first = weighed[0].given
            raise EstimationError(
                f"{first.recording.source.path}: {first.mounting} is said to weigh "
                f"{self._weighed[first.mounting].mass_kg:g} kg, which {Calibrating.lever_m:g} m from a joint take "
                f"{least_nm[0]:.3g} N m; no joint has more than {greatest_nm[0]:.3g} N m here. Is mass_kg in g, or the "
                "recording in another unit?"
            )

    def _noise_warnings(self, fit: Posterior) -> Iterator[str]:
        """Joints of which the runs leave much unexplained."""
        share = self._noise_share(fit)
        if joints := remarked_joints(share > Calibrating.unexplained, "{:.0f} %", 100.0 * share):
            yield (
                f"part of the torque of {joints} remains unexplained: runs contradict each other, and which of "
                "them is wrong is not clear, or the arm is not the configured one. Add runs."
            )

    def _mass_warnings(self, fit: Posterior) -> Iterator[str]:
        """Weighed masses that contradict all other data."""
        for name, payload in self._weighed.items():
            if name not in fit.problem.mountings or payload.whole is not None:
                continue
            place = fit.problem.place(PAYLOAD, name).start
            found, spread = fit.x[place], fit.bread[place, place]
            scale = (WEIGHED_WITHIN * payload.mass_kg) ** 2
            if (information := 1.0 / spread - 1.0 / scale) <= 0.0:
                continue
            others_kg = (found / spread - payload.mass_kg / scale) / information
            deviation = HALVES / np.sqrt(information)
            if abs(payload.mass_kg - others_kg) > Calibrating.mass_off * float(np.hypot(deviation, np.sqrt(scale))):
                yield (
                    f"mounting '{name}': {payload.mass_kg:.3f} kg was entered, all other data give {others_kg:.3f} +- "
                    f"{2.0 * deviation:.3f} kg ({100.0 * (payload.mass_kg / others_kg - 1.0):+.1f} %). Weigh it "
                    "again with all that was mounted; else another weighed mass, or all nominal gains, are wrong."
                )

    def _friction_warnings(self, fit: Posterior) -> Iterator[str]:
        """Runs whose friction differs greatly from that of the others."""
        for index, used in enumerate(self._used):
            change = np.abs(fit.value(FRICTION_CHANGE, (index, 0)) / fit.change_deviation)
            far = change.reshape(CHANGES, -1)[:2].max(axis=0)
            joint = int(np.argmax(far))
            if far[joint] > Calibrating.far:
                yield (
                    f"{used.name}: the friction of joint {joint + 1} is {far[joint]:.0f} standard deviations "
                    "from that of the other runs: a cold gear, or a different gain on that day."
                )

    def _motion_warnings(self, found: ArmCalibration) -> Iterator[str]:
        """Joints whose torque on other motions is uncertain."""
        share = np.max([doubtful_share(found, found.level(self._chain), run.motion) for run in self._used], axis=0)
        if joints := remarked_joints((share > Calibrating.doubtful) & self._moves, "{:.0f} %", 100.0 * share):
            yield (
                f"for other motions, the error of the predicted torque of {joints} may be this large (95 %): add "
                "runs with other motions, especially if payloads will be identified without an unloaded run."
            )

    def _named(self, fit: Posterior, warnings: list[str], robot: str, provenance: Provenance) -> ArmCalibration:
        """The fit as `ArmCalibration`."""
        n, places = self._chain.n, places_of(self._layout.base)
        arm, gains = places[TILT].stop, places[GAIN]
        slowest = TURN_OVER * np.where(self._moves, self._layout.peak_rad_s, 1.0)
        effort = Effort.TORQUE if self._from_torque else Effort.CURRENT
        nominal = np.ones(n) if effort is Effort.TORQUE else self._transmission.gain_nm_a
        # The gain is the nominal one divided by h, so that the sign of its logarithm's error is opposite.
        turn = np.ones(arm)
        turn[gains] = -1.0
        body = identified_body(fit, self._layout.base, slowest, np.zeros((CHANGES, n)))
        elastic = fit.response(*elastic_torque(fit, self._chain, body))
        spread = fit.covariance + elastic @ elastic.T
        deviation = HALVES * np.sqrt(np.diag(spread))
        return ArmCalibration(
            robot=robot,
            effort=effort,
            gain_nm_a=nominal * np.exp(-fit.value(GAIN)),
            nominal=nominal,
            body=body,
            tilt_rad=fit.value(TILT),
            covariance=HALVES**2 * spread[:arm, :arm] * turn[:, None] * turn,
            drift=fit.change_deviation.reshape(CHANGES, n),
            noise_nm=fit.residual_nm[0],
            correlation_s=fit.correlation[0]
            * float(np.median(np.concatenate([np.diff(run.rows.rows.time_s) for run in self._used]))),
            level_nm=fit.problem.noise.greatest_nm,
            payloads=tuple(
                CalibratedPayload(
                    mounting=name,
                    weighed_kg=self._weighed[name].mass_kg if name in self._weighed else float("nan"),
                    theta=fit.value(PAYLOAD, name),
                    deviation=deviation[fit.problem.place(PAYLOAD, name)],
                )
                for name in fit.problem.mountings
            ),
            runs=tuple(
                CalibratedRun(
                    name=used.name,
                    mounting=used.given.mounting,
                    recorded=used.given.recorded or run_start_text(used.given.recording),
                    residual_rms_nm=fit.deviates(index) * fit.noise_nm[0],
                    off=float(np.sqrt(np.mean((fit.deviates(index) * fit.noise_nm[0] / fit.residual_nm[0]) ** 2))),
                    friction_changes=fit.value(FRICTION_CHANGE, (index, 0)).reshape(CHANGES, n),
                    influence=np.abs(fit.change_without(index)[gains]) / deviation[gains],
                    rows=len(used.rows.rows.time_s),
                    struck=int(np.count_nonzero(fit.groups[index].struck)),
                    **_effort_change(fit, index),
                )
                for index, used in enumerate(self._used)
            ),
            left_out=tuple(self._left_out),
            warnings=(*warnings, *self._undetermined(fit), *_tilt_warnings(fit)),
            kinematics_sha256=kinematics_sha256(self._chain),
            provenance=provenance,
        )

    def _undetermined(self, fit: Posterior) -> Iterator[str]:
        """Quantities that no run determines."""
        if not self._moves.all():
            yield f"no run moves {numbered_joints(~self._moves)}: gain and friction are as assumed."
        if not any(name in fit.problem.mountings for name in self._weighed):
            yield (
                "no payload was weighed: only the ratios of the gains are identified, their common scale is that of "
                "the nominal gains. Add a run with a weighed payload and its mass_kg."
            )


def _tilt_warnings(fit: Posterior) -> Iterator[str]:
    """A base that is tilted by more than a spirit level leaves."""
    tilt_rad = float(np.linalg.norm(fit.value(TILT)))
    if tilt_rad > Calibrating.disagrees * TILT_DEVIATION_RAD:
        yield (
            f"the runs show a base that is tilted by {np.degrees(tilt_rad):.1f} deg against the configured gravity. "
            "Correct gravity_m_s2: excitations and limits use it as configured."
        )


def _effort_change(fit: Posterior, index: int) -> dict[str, float]:
    """Common factor of a run's efforts minus 1, beside all other unknowns, and its standard deviation."""
    gradient, information = fit.beside(fit.groups[index].torque[0].predicted_nm[None], first=index)
    deviation = float(information[0, 0] ** -0.5)
    return {
        "effort_change": float(gradient[0]) * deviation**2,
        "effort_change_deviation": HALVES * deviation,
    }


def _distinct(paths: Sequence[Path]) -> list[str]:
    """Names of files with enough folders to be unique; files given twice are numbered."""
    deepest = max((len(path.parts) for path in paths), default=1)
    for depth in range(1, deepest + 1):
        names = ["/".join(path.parts[-depth:]) for path in paths]
        if len(set(names)) == len(names):
            return names
    return [f"{path.name} ({number})" for number, path in enumerate(paths, 1)]
