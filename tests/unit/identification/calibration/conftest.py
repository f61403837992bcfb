"""Six runs of Pinocchio's arm with nominal gains, and the calibration that they give."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.model.payload import InertialParameters
from armload_identification.recording.run_format import RUN_ATTACHMENT
from armload_identification.signals.joint_torque import Transmission
from tests.mounted_runs import LOAD_FRICTION, WRONG, calibrated, named


@pytest.fixture(scope="session")
def nominal(pinocchio_arm):
    """Assumed gains; the arm's own are these times WRONG."""
    return Transmission(pinocchio_arm.transmission.gain_nm_a / WRONG, pinocchio_arm.transmission.coupling)


@pytest.fixture(scope="session")
def other(pinocchio_arm):
    """The same arm with another payload."""
    arm = type(pinocchio_arm)()
    arm.payload = InertialParameters.from_center_of_mass(2.5, [-0.06, 0.09, 0.12], 0.02 * np.eye(3))
    return arm


@pytest.fixture(scope="session")
def runs(pinocchio_arm, other):
    """Six runs on two trajectories: empty, with a weighed payload, and with an unweighed one.

    The empty ones do not state when they were made, the others have an entry in the table or in the recording.
    """
    made = []
    for seed in (3, 4):
        trajectory = pinocchio_arm.trajectory(seed, period_s=10.0)
        for name, arm in (("", pinocchio_arm), ("weighed", pinocchio_arm), ("other", other)):
            run = arm.run(
                trajectory, bool(name), seed=10 * seed + len(name), load_friction=LOAD_FRICTION, with_phase=False
            )
            run = named(run, f"{name or 'empty'}{seed}")
            if name == "other":
                attached = {RUN_ATTACHMENT: json.dumps({"created": f"2026-03-1{seed}T08:00:00+00:00"})}
                run = replace(run, source=replace(run.source, attachments=attached))
            made.append(MountedRun(run, name, recorded="2026-03-01T09:30:00" if name == "weighed" else ""))
    return made


@pytest.fixture(scope="session")
def four(runs):
    """The runs without the unweighed payload."""
    return [run for run in runs if run.mounting != "other"]


@pytest.fixture(scope="session")
def weighed(pinocchio_arm):
    return {"weighed": WeighedPayload(pinocchio_arm.payload.mass_kg)}


@pytest.fixture(scope="session")
def steps():
    """Progress messages of `result`."""
    return []


@pytest.fixture(scope="session")
def result(runs, weighed, pinocchio_arm, nominal, steps):
    return calibrated(runs, weighed, pinocchio_arm, nominal, progress=lambda done, total: steps.append((done, total)))
