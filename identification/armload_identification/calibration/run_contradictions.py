"""Explains why a run contradicts the arm identified from the other runs.

A few mistakes explain most of these runs. Each is tried on the run, with the arm from the other runs: another payload,
a motor that reports a multiple or the negative of its effort, two exchanged joints, an inverted joint, an arm mounted
on a wall or a ceiling.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np

from armload_identification.calibration.calibration_constants import Calibrating, Contradiction
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.estimation.arm_rows import ArmLayout
from armload_identification.estimation.arm_terms import (
    ARM_TERMS,
    PAYLOAD,
    known_arm_terms,
    own_friction,
    payload_term,
)
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import EMPTY, Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.model.other_mountings import directions
from armload_identification.model.payload import InertialParameters, derived
from armload_identification.model.regressor import PARAMETERS
from armload_identification.signals.motion import Motion
from armload_identification.verdict.recording_checks.column_mistakes import reordered

_ZERO: Final = 1e-12
_GRAMS: Final = 1000.0
_OTHER_PAYLOAD: Final = "payload"
Explained = tuple[Posterior, str]
"""A run fitted after the correction of a mistake, and the mistake."""


@dataclass(frozen=True, eq=False)
class ArmKnowledge:
    """The arm from the other runs, with everything required to test a run on it.

    Attributes:
        fit: Fit of the other runs.
        layout: The configured arm.
        drift: The expected change of the run's friction, in multiples of that between the other runs.
    """

    fit: Posterior
    layout: ArmLayout
    drift: float = 1.0


def at_axes(matrix: FloatArray, coupling: FloatArray) -> FloatArray:
    """(n, n) factor on joint torques that multiplies axis torques by (n, n) `matrix`; `coupling` is C of the motors."""
    return np.asarray(coupling @ matrix @ np.linalg.inv(coupling))


def explain(
    arm: ArmKnowledge, run: Motion, mounting: str, mass_kg: float | None, *, among_all: float, gross: bool
) -> str | None:
    """Explain what is wrong with a run.

    Args:
        arm: The arm from the other runs.
        run: The run that contradicts them.
        mounting: Stated name of its payload; empty for an empty arm.
        mass_kg: The stated mass; None if not stated.
        among_all: Its greatest residual in the fit of all runs, in multiples of their noise.
        gross: Whether it is wrong even if no mistake explains it.

    Returns:
        One sentence; None if it does not contradict them, or only as another model's error might.
    """
    elsewhere = mounting in arm.fit.problem.mountings
    off = _fitted_to_run(arm, run, mounting, mass_kg=None if elsewhere else mass_kg).deviates(0)
    worst = int(np.argmax(off))
    if max(float(off[worst]), among_all) < Contradiction.contradicts:
        return None
    start = f"joint {worst + 1} is off by {off[worst]:.0f} times the noise of the other runs"
    # If no other run carries this payload, it is fitted in every trial; another payload is therefore preferred unless a
    # mistake explains much more.
    mistakes = _mistakes(arm, run, mounting, mass_kg)
    payload, *others = [(float(trial.deviates(0).max()), text) for trial, text in mistakes]
    best, text = min(others, key=lambda pair: pair[0])
    if payload[0] < best / Contradiction.better:
        best, text = payload
    if best < max(Contradiction.explained * float(off[worst]), Contradiction.contradicts):
        return f"{start}; it fits if {text}"
    return f"{start}, and no usual mistake explains this: a different arm, or damaged signals" if gross else None


def _fitted_to_run(
    arm: ArmKnowledge, run: Motion, mounting: str, *, free: bool = False, mass_kg: float | None = None
) -> Posterior:
    """Fit of a run's own friction, and of its payload if unknown, with the mass if that is stated, on the arm."""
    fit = arm.fit
    loaded = bool(mounting) or free
    terms = known_arm_terms({name: fit.value(name) for name in ARM_TERMS}, "the other runs")
    if mounting in fit.problem.mountings and not free:
        terms.append(payload_term(fit.value(PAYLOAD, mounting), np.zeros(PARAMETERS), "the other runs"))
    else:
        terms.append(payload_term(np.zeros(PARAMETERS), np.full(PARAMETERS, Contradiction.wide), "any payload"))
    terms.append(own_friction(arm.drift * fit.change_deviation, "as between the other runs"))
    group = Group((RunRows(arm.layout.rows(run, loaded=loaded), _OTHER_PAYLOAD if loaded else EMPTY),))
    noise = Noise.given(fit.noise_nm[0], fit.correlation[0])
    known = [] if mass_kg is None else [WeighedPayload(mass_kg).known(_OTHER_PAYLOAD)]
    return solve(Problem(terms, [group], noise, arm.layout.coupling, known), rough=True)


def _mistakes(arm: ArmKnowledge, run: Motion, mounting: str, mass_kg: float | None) -> Iterator[Explained]:
    """All possible mistakes, each with the run tested after its correction."""
    trial = _fitted_to_run(arm, run, mounting, free=True)
    elsewhere = None
    if mounting in arm.fit.problem.mountings:
        place = arm.fit.problem.place(PAYLOAD, mounting)
        elsewhere = _Carried(arm.fit.x[place], arm.fit.covariance[place, place])
    place = trial.problem.place(PAYLOAD, _OTHER_PAYLOAD)
    yield trial, _payload_text(_Carried(trial.x[place], trial.bread[place, place]), mounting, mass_kg, elsewhere)
    yield _scaled(arm, run, mounting)
    chain, n, coupling = arm.layout.chain, arm.layout.chain.n, arm.layout.coupling

    def turned(joints: FloatArray, torques: FloatArray) -> Posterior:
        return _fitted_to_run(arm, run.turned(joints, torques), mounting)

    for one, other in combinations(range(n), 2):
        swap = reordered(n, (one, other), 1)
        torques, names = at_axes(swap, coupling), f"joints {one + 1} and {other + 1}"
        yield turned(swap, torques), f"{names} are exchanged"
        yield turned(np.eye(n), torques), f"the efforts of {names} are exchanged"
    for joint in range(n):
        turn = reordered(n, (joint,), 1)
        yield turned(turn, np.eye(n)), f"the position of joint {joint + 1} is inverted"
        yield turned(turn, at_axes(turn, coupling)), f"position and effort of joint {joint + 1} are inverted"
    for how, gravity in directions(chain.gravity_m_s2).items():
        mounted = replace(arm, layout=replace(arm.layout, chain=chain.under(gravity)))
        yield _fitted_to_run(mounted, run, mounting), f"the arm was mounted {how} in this run"


@dataclass(frozen=True, eq=False)
class _Carried:
    """A payload: (10,) theta and (10, 10) covariance."""

    theta: FloatArray
    covariance: FloatArray


def _payload_text(found: _Carried, mounting: str, mass_kg: float | None, elsewhere: _Carried | None) -> str:
    """The run's payload, compared with the stated one and with that of other runs of its mounting."""
    found_kg = float(found.theta[0])
    grams_kg = 0.0 if mass_kg is None else mass_kg / _GRAMS
    if grams_kg and found_kg > Contradiction.light_kg and abs(np.log(grams_kg / found_kg)) < Contradiction.roughly:
        return f"it carries {found_kg:.3f} kg, not {mass_kg:g} kg: mass_kg was entered in grams"
    if found_kg < Contradiction.light_kg + Contradiction.light_share * (mass_kg or 0.0):
        return "it carries nothing"
    if elsewhere is None:
        said = f"{mass_kg:.3f} kg" if mass_kg is not None else "nothing"
        return f"it carries {found_kg:.3f} kg, not {said}"
    elsewhere_kg = float(elsewhere.theta[0])
    if abs(found_kg - elsewhere_kg) < Contradiction.same_mass * elsewhere_kg:
        (here, of_here), (there, of_there) = (derived(InertialParameters(one.theta)) for one in (found, elsewhere))
        both = of_here @ found.covariance @ of_here.T + of_there @ elsewhere.covariance @ of_there.T
        apart = (here - there)[1:4]
        if apart @ np.linalg.solve(both[1:4, 1:4], apart) > Calibrating.disagrees**2:
            return (
                "its payload is mounted differently, with the centre of mass "
                f"{1e3 * float(np.sqrt(apart @ apart)):.0f} mm from where it is in the other runs of "
                f"'{mounting}': give it a mounting name of its own"
            )
        deviation_kg = np.sqrt(found.covariance[0, 0] + elsewhere.covariance[0, 0])
        if abs(found_kg - elsewhere_kg) < Calibrating.disagrees * deviation_kg:
            return (
                f"the inertia of its payload differs from that in the other runs of '{mounting}': give it a mounting "
                "name of its own"
            )
    return f"it carries {found_kg:.3f} kg, not {elsewhere_kg:.3f} kg as in the other runs of '{mounting}'"


def _scaled(arm: ArmKnowledge, run: Motion, mounting: str) -> Explained:
    """Axes that report a multiple of their effort."""
    # Freely varying friction would absorb part of a wrong scale.
    coupling = arm.layout.coupling
    share, corrected, stiff = np.ones(arm.layout.chain.n), run, replace(arm, drift=Contradiction.stiff)
    for _ in range(Contradiction.scalings):
        trial = _fitted_to_run(stiff, corrected, mounting)
        rows, state = trial.problem.groups[0], trial.groups[0]
        weighted, predicted = rows.weight * rows.effort_nm[0], rows.weight * state.torque[0].predicted_nm
        now = np.sum(weighted * predicted, axis=0) / np.maximum(np.sum(predicted**2, axis=0), _ZERO)
        off = trial.deviates(0)
        share = share * np.where((off >= max(Contradiction.contradicts, off.max())) | (share != 1.0), now, 1.0)
        share = np.where(np.abs(share) > Contradiction.least_scale, share, Contradiction.least_scale)
        corrected = run.with_torque_times(at_axes(np.diag(1.0 / share), coupling))
    parts = [
        f"the sign of joint {j + 1}'s effort is flipped"
        if abs(share[j] + 1.0) < Contradiction.as_it_is
        else f"joint {j + 1} reports {share[j]:.2f} times its effort (another gear ratio or torque constant)"
        for j in np.flatnonzero(np.abs(share - 1.0) > Contradiction.same_scale)
    ]
    return _fitted_to_run(arm, corrected, mounting), " and ".join(parts) or "nothing is changed"
