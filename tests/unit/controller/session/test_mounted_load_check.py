"""What an arm carries is compared before it runs at full speed: simulated, with something on its flange or not."""

import json
import re
from contextlib import contextmanager
from dataclasses import replace

import msgspec
import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader

from armload_controller.analysis.arm_in_use import arm_in_use
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import MotionError
from armload_controller.cycle.slow_round_torque import SlowRoundRows
from armload_controller.session import mounted_load_check
from armload_controller.session.commissioning import ROLES, CommissioningPlan, record_half, recording_path
from armload_controller.session.mounted_load_check import loaded_doubts, recorded_slow_round, unloaded_doubts
from armload_controller.session.run_session import NoDisplay, no_operator
from armload_controller.session.session_load import SessionLoad
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.model.payload import InertialParameters
from benchmarks.arms.misread_arm import (
    MisreadPlant,
    Mistake,
    displaced_zero,
    exchanged,
    reversed_axis,
    scaled_gear,
    scaled_torque,
    tilted_base,
)
from benchmarks.arms.setups import Twin, twin_spec
from tests.fake_servos import FakeServos
from tests.short_commissioning import MIDDLE_RAD, least_robot, record
from tests.unit.conftest import pinocchio_model

AVERAGED_S = 0.1

PRBT = load_robot("prbt")
ARM = arm_in_use(PRBT)
PAYLOAD = InertialParameters.from_center_of_mass(3.0, [0.02, -0.03, 0.08], 0.01 * np.eye(3))
LIGHT = InertialParameters.from_center_of_mass(0.05, [0.02, -0.03, 0.08], 1e-4 * np.eye(3))
SAME = "the arm carries the same as before, or at most "


RIGHT = Mistake.none(6)


def slow_round(payload, seed=0, mistake=RIGHT):
    """Rows of a slow motion, with gravity by Pinocchio, friction and noise, read through a mistake of the file."""
    rng = np.random.default_rng(seed)
    middle = np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0])
    path = FourierTrajectory(1 / 40.0, middle, *np.random.default_rng(1).normal(0.0, 0.35, (2, 6, 2)))
    links = [InertialParameters(each) for each in PRBT.strength.arm_body.links]
    model = pinocchio_model(PRBT.chain, links, payload)
    data, rows = model.createData(), SlowRoundRows(AVERAGED_S)
    states = path.evaluate(np.arange(0.0, 40.0, AVERAGED_S))
    tilt = np.radians(mistake.tilt_deg)
    model.gravity.linear = 9.81 * np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    for q, dq in zip(states.position_rad, states.velocity_rad_s, strict=True):
        p, dp = mistake.position @ q + mistake.zero_rad, mistake.position @ dq
        friction = 3.0 * np.tanh(dp / 0.01)
        torque = pin.computeGeneralizedGravity(model, data, p) + friction + rng.normal(0.0, 0.5, 6)
        rows.add(q, mistake.torque @ torque, None)
    return rows


@pytest.mark.parametrize(
    ("mistake", "text"),
    [
        (scaled_torque(6, 1, 0.7), r"prbt_joint_2: its torque seems to be 0\.7\d? times .* rated_torque_nm by 0\.7"),
        (scaled_torque(6, 2, 1.5), r"prbt_joint_3: its torque seems to be 1\.\d times"),
        (reversed_axis(6, 1), r"prbt_joint_2 seems to turn the other way: reverse its axis .* \(607E\)"),
        (scaled_gear(6, 1, 0.8), r"prbt_joint_2 seems to turn 0\.[78]\d times .* divide its gear_ratio by 0\.[78]"),
        (exchanged(6, 1, 2), "prbt_joint_2 and prbt_joint_3 seem to be exchanged: exchange their node_id"),
        (displaced_zero(6, 2, 0.2), r"prbt_joint_3 seems to stand at \+1[0-4] degrees where it reports zero"),
        (tilted_base(6, 30.0), r"the base seems to be mounted \d\d degrees otherwise: .*gravity_m_s2 = \[-?0\.\d+, -"),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_a_mistake_in_the_file_is_named_with_what_to_change(mistake, text):
    (found,) = unloaded_doubts(PRBT, ARM, slow_round(None, mistake=mistake))
    assert re.match(f"the weight of the arm is not as expected. {text}", found), found


@pytest.mark.long
def test_a_stop_by_the_torque_window_in_the_slow_round_names_the_mistake(tmp_path):
    """On the other excitation the arm is stopped before enough was seen."""
    robot = replace(PRBT, excitations=dict.fromkeys(ROLES, PRBT.excitations["validation"]))
    plant = MisreadPlant(twin_spec(PRBT, Twin.NORMATIVE, None), exchanged(6, 1, 2))
    named = "prbt_joint_2 and prbt_joint_3 seem to be exchanged: exchange their node_id"
    with pytest.raises(MotionError, match=f"torque is not as expected: .*Next: .*until then: .*{named}"):
        record(robot, tmp_path, lambda: FakeServos(PRBT.drives.settings, plant), (SessionLoad.UNLOADED,))


@pytest.mark.parametrize("seed", range(6))
def test_links_that_are_wrong_by_a_tenth_are_no_mistake(seed):
    body = PRBT.tables.body
    factors = 1.0 + 0.1 * np.random.default_rng(seed).standard_normal(6)
    links = [
        msgspec.structs.replace(link, mass_kg=link.mass_kg * factor)
        for link, factor in zip(body.links, factors, strict=True)
    ]
    robot = PRBT.with_tables(body=msgspec.structs.replace(body, links=links))
    assert unloaded_doubts(robot, ARM, slow_round(None, seed)) == []


def test_a_payload_in_the_unloaded_run_is_reported_with_its_mass():
    (text,) = unloaded_doubts(PRBT, ARM, slow_round(PAYLOAD))
    kg, spread = text.removeprefix("the arm carries ").split(" kg in this unloaded run")[0].split(" +- ")
    assert float(kg) == pytest.approx(3.0, abs=float(spread))
    assert float(spread) < 1.5
    assert unloaded_doubts(PRBT, ARM, slow_round(None)) == []


def test_a_calibration_is_preferred_to_a_body(calibration, pinocchio_arm):
    arm = replace(ARM, chain=pinocchio_arm.chain, transmission=pinocchio_arm.transmission, calibration=calibration)
    rows = SlowRoundRows(AVERAGED_S)
    for loaded in (False, True):
        run = pinocchio_arm.run(pinocchio_arm.trajectory(), loaded, seed=1, periods=1, rate=10.0, noise=0.3)
        for q, current in zip(run.position_rad, run.current_a, strict=True):
            rows.add(q, None, current)
        assert bool(unloaded_doubts(PRBT, arm, rows)) is loaded
        rows = SlowRoundRows(AVERAGED_S)


def test_without_body_and_calibration_nothing_is_compared():
    bodiless = PRBT.with_tables(body=None)
    assert unloaded_doubts(bodiless, ARM, slow_round(PAYLOAD)) == []


@pytest.mark.parametrize(
    ("before", "now", "noticed"), [(None, PAYLOAD, False), (PAYLOAD, PAYLOAD, True), (None, None, True)]
)
def test_a_loaded_run_with_nothing_added_is_reported(monkeypatch, tmp_path, before, now, noticed):
    monkeypatch.setattr(mounted_load_check, "recorded_slow_round", lambda path, cycle_s: slow_round(before, seed=2))
    texts = loaded_doubts(PRBT, ARM, tmp_path, slow_round(now))
    assert [text.startswith(SAME) for text in texts] == [True] * noticed


def test_an_expected_payload_too_light_to_be_noticed_is_not_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr(mounted_load_check, "recorded_slow_round", lambda path, cycle_s: slow_round(None, seed=2))
    light = msgspec.structs.replace(PRBT.tables.expected_payload, mass_kg=LIGHT.mass_kg)
    robot = PRBT.with_tables(expected_payload=light)
    assert loaded_doubts(robot, ARM, tmp_path, slow_round(LIGHT)) == []


def test_the_slow_round_of_a_recording_is_read(tmp_path, rubbing_plant, monkeypatch):
    robot = least_robot()
    record(
        robot,
        tmp_path,
        lambda: FakeServos(robot.drives.settings, rubbing_plant(MIDDLE_RAD, np.full(6, 3.0))),
        [SessionLoad.UNLOADED],
    )
    added = []
    monkeypatch.setattr(SlowRoundRows, "add", lambda rows, *row: added.append(row))
    path = recording_path(tmp_path, SessionLoad.UNLOADED, "identification")
    recorded_slow_round(path, 1 / robot.bus.cycle_hz)
    with path.open("rb") as file:
        texts = [
            message.data for *_, message in make_reader(file).iter_messages() if b'"segment":"slow"' in message.data
        ]
    assert len(added) == len(texts) > 100
    position, torque, current = added[-1]
    last = json.loads(texts[-1])
    assert (position.tolist(), torque.tolist(), current) == (last["position_rad"], last["torque_nm"], None)


@pytest.mark.long
def test_a_whole_session_with_the_payload_left_on_the_flange(tmp_path):
    robot = replace(PRBT, excitations={role: replace(each, periods=1) for role, each in PRBT.excitations.items()})
    simulation = robot.simulation
    shown = []

    @contextmanager
    def open_servos(load):
        servos = FakeServos(robot.drives.settings, ArmPlant(simulation.plant_spec(simulation.payload_name)))
        yield servos
        servos.close()

    display = NoDisplay()
    display.step = shown.append
    for load, text in ((SessionLoad.UNLOADED, "warning: the arm carries 3."), (SessionLoad.LOADED, f"warning: {SAME}")):
        record_half(robot, load, open_servos, replace(no_operator(), display=display), CommissioningPlan(tmp_path))
        assert [each for each in shown if each.startswith(text)], "after a slow round"
