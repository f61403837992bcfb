"""Keys during the measured periods, the recording of these runs, and the payload identified from them.

The rows are those of the motion's own interpolator, with torques computed by Pinocchio. After a pause the arm needs
time to settle, as after the start; its lag is part of the recorded positions.
"""

import json

import numpy as np
import pinocchio as pin
import pytest

import armload
from armload_controller.cli.keyboard import Key, press
from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder, phase_of
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.leg_interpolator import LegInterpolator
from armload_controller.motion.motion_control import MotionControl
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.files.payload_file import read_payload
from armload_identification.model.payload import InertialParameters

RATE_HZ = 50.0
PAUSE, SLOWER, FASTER = [Key.PAUSE], [Key.SLOWER] * 5, [Key.FASTER] * 5
LAG_S = 0.04
"""Time constant of the arm's lag after a change of acceleration, shorter than the 0.3 s that are left out."""


@pytest.fixture(scope="module")
def er50():
    return load_robot("er50").with_bus(cycle_hz=RATE_HZ)


@pytest.fixture(scope="module")
def record(er50, in_pinocchio, tmp_path_factory):
    """Record a run of er50 with keys pressed at some phases, and further ones 60 rows later; returns its file."""
    excitation = er50.excitations["identification"]
    checked = check_path(excitation, er50.motion_constraints, 1.0 / RATE_HZ, file="er50.toml", key="identification")
    spec = er50.simulation.plant_spec(None)
    links = [
        InertialParameters.from_center_of_mass(body.mass_kg, body.center_of_mass_m, body.inertia_kg_m2)
        for body in (joint.link for joint in spec.joints)
    ]
    noise_nm = er50.limits.torque_noise_nm / 4.0  # there are fewer rows than from er50's bus

    def record(load, *keys, seed=1):
        rng = np.random.default_rng(seed)
        payload = er50.simulation.payload("paper") if load == "loaded" else None
        model = in_pinocchio(er50.chain, links, payload)
        data = model.createData()
        path = tmp_path_factory.mktemp("paused") / f"{load}.mcap"
        run = {"robot": er50.name, "load": load, "role": "identification", "simulated": True}
        attachments = {
            "configuration.toml": er50.text,
            "excitation.toml": format_excitation(excitation),
            "run.json": json.dumps(run),
        }
        still, missing = np.zeros(er50.n), np.zeros(er50.n, dtype=bool)
        statusword = np.full(er50.n, 0x0637, dtype=np.uint16)
        with Recorder(path, attachments) as recorder:
            for cycle, (reference, lag_rad) in enumerate(lagging(rows(checked.measured.leg, keys))):
                motion = reference.position_rad, reference.velocity_rad_s, reference.acceleration_rad_s2
                torque = pin.rnea(model, data, *motion) + 5.0 * motion[1] + 4.0 * np.tanh(motion[1] / 0.01)
                torque += noise_nm * rng.normal(size=er50.n) + 1e4 * lag_rad
                current = (torque @ er50.drives.coupling) / er50.drives.transmission.gain_nm_a
                position = reference.position_rad - lag_rad + 2e-5 * rng.normal(size=er50.n)
                feedback = JointFeedback(cycle, cycle / RATE_HZ, position, None, current, None, statusword, missing)
                command = JointCommand(reference.position_rad, still, still)
                recorder.write(feedback, command, reference.segment, phase_of(reference))
        return path

    return record


def rows(leg, keys):
    """The rows of a leg with keys pressed: (phase, first keys, later keys)."""
    control, waiting, later = MotionControl(), list(keys), []
    interpolator = LegInterpolator(leg, 1.0 / RATE_HZ, control)
    for row in range(10**5):
        reference = interpolator.next_reference()
        if reference is None:
            return
        yield reference
        if waiting and reference.state.phase_s >= waiting[0][0]:
            _, now, then = waiting.pop(0)
            later.append((row + 60, then))
            for key in now:
                press(control, key)
        while later and row >= later[0][0]:
            for key in later.pop(0)[1]:
                press(control, key)
    raise AssertionError("the leg does not end")


def lagging(references):
    """Rows with the lag that the end of a ramp causes, and that then disappears."""
    lag_rad, before = 0.0, None
    for reference in references:
        if before is not None and before.segment is not reference.segment:
            lag_rad = lag_rad + 1e-3
        lag_rad = lag_rad * np.exp(-1.0 / (RATE_HZ * LAG_S))
        before = reference
        yield reference, lag_rad


def test_a_payload_is_identified_from_runs_that_were_paused_and_slowed_down(er50, record, tmp_path):
    loaded = record("loaded", (15.0, PAUSE, PAUSE))
    unloaded = record("unloaded", (3.0, SLOWER, FASTER), (14.0, PAUSE, PAUSE), seed=2)
    found = armload.identify(er50, loaded, unloaded)
    truth = er50.simulation.payload("paper")
    for name, value in (("mass", truth.mass_kg), *zip(("cx", "cy", "cz"), truth.center_of_mass_m, strict=True)):
        low, high = found.intervals[name]
        assert low <= value <= high, name
    notes = [note for note in found.notes if "paused" in note]
    assert [note.partition(" within")[0] for note in notes] == [
        "loaded recording: the run was continued, paused or slowed down once",
        "unloaded recording: the run was continued, paused or slowed down 2 times",
    ]
    assert notes[0].endswith("every part of the period at least 3 times.")
    found.save(tmp_path / "payload.toml")
    assert read_payload(tmp_path / "payload.toml").model.mass_kg == found.payload.model.mass_kg
    uninterrupted = armload.identify(er50, record("loaded"), record("unloaded", seed=2))
    assert not [note for note in uninterrupted.notes if "paused" in note]
    widths = [np.diff(findings.payload.interval_95[1:4]).ravel() for findings in (found, uninterrupted)]
    # 0.99, 1.00 and 0.91 times as wide: what all periods share outweighs the noise that more of them average.
    assert (widths[0] > 0.9 * widths[1]).all()
    assert (widths[0] < 1.5 * widths[1]).all()
