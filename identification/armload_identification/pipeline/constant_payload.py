"""Whether the payload stayed the same during each run, which the identification assumes."""

from __future__ import annotations

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.payload_change import PayloadChange, change_between_periods, change_in
from armload_identification.estimation.payload_estimate import PayloadEstimate
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.pipeline.identification_result import Identification
from armload_identification.recording.recording import Recording
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.decision_levels import PayloadChangeLevels


def change_notes(found: Identification, loaded: Run, unloaded: Run | None = None) -> list[str]:
    """A note on each run during which the payload changed.

    A run that was reduced to its average period while it was read, or that was interrupted within its periods, is not
    tested. Of two runs without periods, a change is attributed to the loaded one.

    Args:
        found: The payload, assumed constant.
        loaded: The loaded run.
        unloaded: The unloaded run, if there is one.
    """
    signal = found.signal
    runs = {"loaded": (loaded, signal.loaded, found.plain.theta)}
    if unloaded is not None and signal.unloaded.periods > 1:
        runs["unloaded"] = unloaded, signal.unloaded, np.zeros_like(found.plain.theta)
    notes = []
    for name, (run, motion, theta) in runs.items():
        change = _change(run, motion, found.plain)
        if change is not None and change.statistic > PayloadChangeLevels.statistic:
            notes.append(_note(name, run.recording, motion, theta, change))
    return notes


def _change(run: Run, motion: Motion, plain: PayloadEstimate) -> PayloadChange | None:
    """The most likely change during a run."""
    if motion.periods == 1:
        return change_in(plain.posterior, PayloadChangeLevels.edge_s)
    if run.recording.average is not None or motion.interruptions:
        return None
    return change_between_periods(run, plain.arm, PayloadChangeLevels.edge_s)


def _note(name: str, run: Recording, motion: Motion, theta: FloatArray, found: PayloadChange) -> str:
    """When the payload changed, by how much, and how to identify what was carried before and after that."""
    start_s = 0.0 if run.source.between_s is None else run.source.between_s[0]
    at_s = start_s + motion.began_s - run.time_s[0] + found.at_s
    end_s = start_s + run.time_s[-1] - run.time_s[0]
    apart_s = PayloadChangeLevels.apart_s
    return (
        f"The payload changed during the {name} run, about {at_s:.0f} s after the start of its recording, "
        f"{_by_how_much(theta, found)}. The result is a mean over the run. To identify the parts, use "
        f"`--between {start_s:.0f}s {at_s - apart_s:.0f}s` and `--between {at_s + apart_s:.0f}s {end_s:.0f}s`."
    )


def _by_how_much(theta: FloatArray, found: PayloadChange) -> str:
    """The change of the mass, and that of the centre of mass as far as it is significant."""
    half_width = NORMAL_HALF_WIDTH * found.deviation
    digits = max(1 - int(np.floor(np.log10(half_width[0]))), 0)
    text = f"by {found.change[0]:+z.{digits}f} +- {half_width[0]:.{digits}f} kg"
    mass_kg = float(theta[0])
    after_kg = mass_kg + float(found.change[0])
    if min(mass_kg, after_kg) <= PayloadChangeLevels.least_left * max(mass_kg, after_kg):
        return text
    moved_m = (theta[1:4] + found.change[1:]) / after_kg - theta[1:4] / mass_kg
    if (np.abs(moved_m) * after_kg <= half_width[1:]).all():
        return text
    return f"{text}; its centre of mass moved by {', '.join(f'{1e3 * part:+z.0f}' for part in moved_m)} mm"
