"""Runs of Pinocchio's arm with several payloads, and the calibration that they give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.mounted_runs import ArmRuns
from armload_identification.model.payload import Provenance

WRONG = np.array([1.03, 0.96, 1.05, 0.97, 1.02, 0.98])
LOAD_FRICTION = 0.06


def named(run, name):
    return replace(run, source=replace(run.source, path=run.source.path.with_name(f"{name}.mcap"), sha256=name))


def calibrated(runs, weighed, arm, nominal, chain=None, left_out=(), **more):
    given, made = ArmRuns(tuple(runs), weighed, tuple(left_out)), Provenance("0", "c" * 64, {})
    return calibrate_arm(given, chain or arm.chain, nominal, robot="test", made=made, **more)


def changed(runs, index, **recording):
    """The same runs, one of them with changed signals."""
    out = list(runs)
    out[index] = replace(out[index], recording=replace(out[index].recording, **recording))
    return out
