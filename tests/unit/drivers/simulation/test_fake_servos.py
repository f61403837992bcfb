"""The servos without a bus: life cycle, timing, units and scripted failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.state_machine import State, state_in
from armload_drivers.driver_errors import CommandError, ServoFault, ServoTimeout, SimulationError, StateError
from armload_drivers.servos import JointCommand, JointFeedback, JointServos
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_identification.float_array import FloatArray
from tests.fake_servos import QUICK_STOP_S, FailureKind, FakeServos, ScriptedFailure

pytest.importorskip("mujoco")

FAULT = FailureKind.FAULT
MISSING = FailureKind.MISSING_FEEDBACK


def settings(name: str) -> ArmSettings:
    return load_robot(name).drives.settings


def quiet(name: str) -> PlantSpec:
    """A shipped robot with its payload and without noise, away from its zero position."""
    robot = load_robot(name)
    spec = robot.simulation.plant_spec(robot.simulation.payload_name)
    joints = tuple(replace(joint, torque_noise_nm=0.0) for joint in spec.joints)
    return replace(spec, joints=joints, start_position_rad=np.array([0.2, 0.3, 0.4, -0.5, 0.6, 0.7]))


def hold(feedback: JointFeedback) -> JointCommand:
    """The command that holds a feedback's position."""
    return at(feedback.position_rad)


def at(position_rad: FloatArray, torque_offset_nm: FloatArray | None = None) -> JointCommand:
    still = np.zeros(len(position_rad))
    return JointCommand(position_rad, still, still if torque_offset_nm is None else torque_offset_nm)


def enabled(name: str, failures: Sequence[ScriptedFailure] = ()) -> tuple[FakeServos, ArmPlant, JointFeedback]:
    """Servos in operation, their plant and the first feedback."""
    plant = ArmPlant(quiet(name))
    servos = FakeServos(settings(name), plant, failures)
    servos.connect()
    return servos, plant, servos.enable()


def stay(servos: FakeServos, feedback: JointFeedback, cycles: int) -> JointFeedback:
    """Command a feedback's position for some cycles; returns the last feedback."""
    rows = [servos.exchange(hold(feedback)) for _ in range(cycles)]
    return rows[-1]


def sweep(servos: FakeServos, start: FloatArray, speed_rad_s: float, cycles: int) -> list[JointFeedback]:
    """Move the first joint from `start` at a constant speed."""
    rows = []
    for k in range(1, cycles + 1):
        target = start.copy()
        target[0] += speed_rad_s * k * servos.cycle_s
        rows.append(servos.exchange(at(target)))
    return rows


def states(feedback: JointFeedback) -> set[State]:
    return {state_in(int(word)) for word in feedback.statusword}


class TestLife:
    def test_is_joint_servos_of_a_simulated_arm(self) -> None:
        servos = FakeServos(settings("er50"), ArmPlant(quiet("er50")))
        assert isinstance(servos, JointServos)
        assert (servos.n, servos.cycle_s, servos.simulated) == (6, 0.004, True)

    def test_enabling_holds_where_the_arm_is(self) -> None:
        servos, plant, first = enabled("er50")
        assert states(first) == {State.OPERATION_ENABLED}
        np.testing.assert_allclose(first.position_rad, quiet("er50").start_position_rad, atol=1e-5)
        last = stay(servos, first, 50)
        np.testing.assert_allclose(last.position_rad, first.position_rad, atol=1e-4)
        assert plant.time_s == pytest.approx(last.time_s)

    def test_every_call_in_the_wrong_state_is_refused(self) -> None:
        servos = FakeServos(settings("er50"), ArmPlant(quiet("er50")))
        command = at(np.zeros(6))
        for call in (servos.enable, servos.stop, servos.disable, lambda: servos.exchange(command)):
            with pytest.raises(StateError):
                call()
        servos.connect()
        with pytest.raises(StateError, match="already connected"):
            servos.connect()
        with pytest.raises(StateError, match="must be enabled"):
            servos.exchange(command)
        servos.enable()
        with pytest.raises(StateError, match="connected and disabled"):
            servos.enable()
        servos.stop()
        with pytest.raises(StateError, match="must be enabled"):
            servos.exchange(command)
        with pytest.raises(StateError, match="connected and disabled"):
            servos.enable()
        servos.disable()
        with pytest.raises(StateError, match="must be enabled"):
            servos.exchange(command)
        servos.close()
        with pytest.raises(StateError, match="must be connected"):
            servos.enable()

    def test_stop_and_disable_may_be_repeated_and_close_from_any_state(self) -> None:
        servos, plant, _ = enabled("er50")
        servos.stop()
        stopped_at = plant.time_s
        servos.stop()
        assert plant.time_s == stopped_at
        servos.disable()
        servos.disable()
        servos.close()
        servos.close()

    def test_arm_can_be_enabled_again_after_it_was_disabled(self) -> None:
        servos, _, first = enabled("prbt")
        servos.stop()
        servos.disable()
        again = servos.enable()
        np.testing.assert_allclose(again.position_rad, first.position_rad, atol=1e-4)
        assert servos.exchange(hold(again)).cycle == again.cycle + 1

    def test_connecting_anew_counts_from_the_beginning(self) -> None:
        servos, _, _ = enabled("er50")
        servos.close()
        servos.connect()
        assert servos.enable().cycle == 1

    def test_settings_for_another_number_of_joints(self) -> None:
        arm = settings("er50")
        with pytest.raises(SimulationError, match="5 drives are configured for a plant of 6 joints"):
            FakeServos(replace(arm, drives=arm.drives[:5]), ArmPlant(quiet("er50")))


class TestStopping:
    def test_quick_stop_is_even_and_the_arm_holds_with_torque_on(self) -> None:
        servos, plant, first = enabled("er50")
        moving = sweep(servos, first.position_rad, 0.5, 250)[-1]
        servos.stop()
        now = plant.sample(servos.cycle_s)
        assert np.abs(now.axis_velocity_rad_s).max() < 1e-3
        # Lag of 1/25 s, one cycle of delay, and half the speed over the time of the ramp.
        travel = now.joint_position_rad[0] - moving.position_rad[0]
        assert travel == pytest.approx(0.5 * (1.0 / 25.0 + servos.cycle_s + QUICK_STOP_S / 2.0), abs=2e-3)
        assert np.abs(now.axis_torque_nm).max() > 100.0

    def test_disabling_waits_for_standstill(self) -> None:
        servos, plant, first = enabled("er50")
        sweep(servos, first.position_rad, 0.5, 250)
        servos.disable()
        now = plant.sample(servos.cycle_s)
        assert np.abs(now.axis_velocity_rad_s).max() < 1e-3
        np.testing.assert_array_equal(now.axis_torque_nm, np.zeros(6))

    def test_closing_in_motion_ends_without_torque_standing(self) -> None:
        servos, plant, first = enabled("er50")
        sweep(servos, first.position_rad, 0.5, 250)
        servos.close()
        before = plant.sample(servos.cycle_s).joint_position_rad
        plant.advance(plant.time_s + 0.5)
        after = plant.sample(servos.cycle_s)
        np.testing.assert_allclose(after.joint_position_rad, before, atol=1e-5)
        np.testing.assert_array_equal(after.axis_torque_nm, np.zeros(6))

    def test_falling_axis_without_brake_is_reported(self) -> None:
        spec = quiet("prbt")
        joints = list(spec.joints)
        joints[1] = replace(joints[1], has_brake=False, coulomb_nm=0.0, stribeck_nm=0.0, viscous_nm_s_rad=0.0)
        plant = ArmPlant(replace(spec, joints=tuple(joints)))
        servos = FakeServos(settings("prbt"), plant, [ScriptedFailure(FAULT, joint=1, cycle=5)])
        servos.connect()
        first = servos.enable()
        with pytest.raises(ServoFault):
            stay(servos, first, 10)
        with pytest.raises(ServoTimeout, match=r"quick stop: still turning at .* rad/s") as caught:
            servos.close()
        assert caught.value.node_id == settings("prbt").drives[1].node_id
        servos.close()
        with pytest.raises(StateError):
            servos.stop()


class TestTiming:
    def test_command_is_reached_one_cycle_after_the_sync_that_latched_it(self) -> None:
        servos, plant, first = enabled("er50")
        target = first.position_rad + 0.002
        latched = servos.exchange(at(target))
        coupling = settings("er50").coupling
        demand = coupling @ plant.sample(servos.cycle_s).axis_demand_rad
        np.testing.assert_allclose(demand, first.position_rad, atol=1e-5)
        np.testing.assert_allclose(latched.position_rad, first.position_rad, atol=1e-5)
        servos.exchange(at(target))
        demand = coupling @ plant.sample(servos.cycle_s).axis_demand_rad
        np.testing.assert_allclose(demand, target, atol=1e-6)

    def test_cycles_are_counted_and_stamped(self) -> None:
        servos, _, first = enabled("prbt")
        rows = [first, *(servos.exchange(hold(first)) for _ in range(5))]
        assert [row.cycle for row in rows] == [1, 2, 3, 4, 5, 6]
        np.testing.assert_allclose(np.diff([row.time_s for row in rows]), 0.01)
        assert not any(row.missing.any() or row.skipped_cycles for row in rows)


class TestUnits:
    def test_currents_are_the_motors_in_per_mille_of_rated(self) -> None:
        servos, plant, first = enabled("er50")
        row = sweep(servos, first.position_rad, 0.5, 100)[-1]
        assert row.torque_nm is None
        assert row.velocity_rad_s is None
        assert row.current_a is not None
        drives = settings("er50").drives
        rated_a = np.array([drive.rated_current_a for drive in drives], dtype=np.float64)
        rated_nm = np.array([drive.rated_torque_nm for drive in drives])
        permille = row.current_a / rated_a * 1000.0
        np.testing.assert_allclose(permille, np.round(permille), atol=1e-9)
        torque = plant.sample(servos.cycle_s).axis_torque_nm
        np.testing.assert_allclose(permille, torque / rated_nm * 1000.0, atol=0.5)
        assert abs(permille[0]) > 50.0

    def test_torques_are_the_joints_in_per_mille_of_rated(self) -> None:
        servos, plant, first = enabled("prbt")
        row = sweep(servos, first.position_rad, 0.5, 100)[-1]
        assert row.current_a is None
        assert row.torque_nm is not None
        rated_nm = np.array([drive.rated_torque_nm for drive in settings("prbt").drives])
        permille = row.torque_nm / rated_nm * 1000.0
        np.testing.assert_allclose(permille, np.round(permille), atol=1e-9)
        torque = plant.sample(servos.cycle_s).axis_torque_nm
        np.testing.assert_allclose(permille, torque / rated_nm * 1000.0, atol=0.5)

    def test_positions_are_whole_counts_of_the_axes(self) -> None:
        servos, plant, _ = enabled("prbt")
        target = np.array([0.2, 0.3, 0.4, -0.5, 0.6, 0.7]) + 1e-6
        for _ in range(3):
            row = servos.exchange(at(target))
        counts_per_rad = np.array([drive.counts_per_rad for drive in settings("prbt").drives])
        counts = row.position_rad * counts_per_rad
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        demand = plant.sample(servos.cycle_s).axis_demand_rad * counts_per_rad
        np.testing.assert_allclose(demand, np.round(target * counts_per_rad), atol=1e-6)

    def test_torque_offset_is_given_to_the_coupled_axes(self) -> None:
        servos, plant, first = enabled("er50")
        before = plant.sample(servos.cycle_s).axis_torque_nm
        offset = np.array([0.0, 200.0, 0.0, 0.0, 20.0, 30.0])
        servos.exchange(at(first.position_rad, offset))
        plant.advance(plant.time_s + 0.001)
        expected = settings("er50").coupling.T @ offset
        per_permille = np.array([drive.rated_torque_nm for drive in settings("er50").drives]) / 1000.0
        change = plant.sample(servos.cycle_s).axis_torque_nm - before
        assert expected[3] != 0.0
        np.testing.assert_allclose(change, expected, atol=0.5 * per_permille.max() + 0.2)

    def test_offset_is_gone_after_disabling(self) -> None:
        servos, _, first = enabled("er50")
        servos.exchange(at(first.position_rad, np.full(6, 5.0)))
        servos.disable()
        again = servos.enable()
        np.testing.assert_allclose(stay(servos, again, 50).position_rad, again.position_rad, atol=2e-5)

    def test_command_that_is_no_number_moves_nothing(self) -> None:
        servos, plant, first = enabled("er50")
        now = plant.time_s
        with pytest.raises(CommandError):
            servos.exchange(at(np.full(6, math.nan)))
        assert plant.time_s == now
        assert servos.exchange(hold(first)).cycle == first.cycle + 1


class TestFailures:
    def test_fault_names_node_and_joint_and_engages_the_brake(self) -> None:
        servos, plant, first = enabled("er50", [ScriptedFailure(FAULT, joint=1, cycle=4)])
        servos.exchange(hold(first))
        servos.exchange(hold(first))
        drive = settings("er50").drives[1]
        with pytest.raises(ServoFault, match=rf"{drive.joint} \(node {drive.node_id}\)") as caught:
            servos.exchange(hold(first))
        assert caught.value.joint == drive.joint
        with pytest.raises(ServoFault):
            servos.exchange(hold(first))
        now = plant.sample(servos.cycle_s)
        assert now.axis_torque_nm[1] == 0.0
        assert np.abs(now.axis_torque_nm[2]) > 50.0
        np.testing.assert_allclose(now.joint_position_rad, first.position_rad, atol=1e-3)

    def test_faulted_arm_can_be_stopped_but_not_enabled_again(self) -> None:
        servos, _, first = enabled("er50", [ScriptedFailure(FAULT, joint=0, cycle=2)])
        with pytest.raises(ServoFault):
            servos.exchange(hold(first))
        servos.stop()
        servos.disable()
        with pytest.raises(ServoFault, match="enabling"):
            servos.enable()
        servos.close()

    def test_following_error_is_a_fault(self) -> None:
        arm = settings("er50")
        narrow = replace(arm.drives[0], following_error_rad=0.02)
        servos = FakeServos(replace(arm, drives=(narrow, *arm.drives[1:])), ArmPlant(quiet("er50")))
        servos.connect()
        with pytest.raises(ServoFault, match=narrow.joint):
            sweep(servos, servos.enable().position_rad, 1.0, 20)

    def test_missing_feedback_repeats_the_last_values(self) -> None:
        servos, _, first = enabled("prbt", [ScriptedFailure(MISSING, joint=0, cycle=21, cycles=2)])
        rows = sweep(servos, first.position_rad, 0.5, 25)
        missing = np.array([row.missing for row in rows])
        assert [rows[k].cycle for k in np.flatnonzero(missing[:, 0])] == [21, 22]
        assert not missing[:, 1:].any()
        moved = np.diff([row.position_rad[0] for row in rows])
        begin = int(np.flatnonzero(missing[:, 0])[0])
        np.testing.assert_array_equal(moved[begin - 1 : begin + 1], [0.0, 0.0])
        assert moved[begin + 1] > 0.01

    def test_feedback_missing_for_longer_than_configured(self) -> None:
        allowed = settings("prbt").max_missing_cycles
        servos, _, first = enabled("prbt", [ScriptedFailure(MISSING, joint=3, cycle=2, cycles=100)])
        for _ in range(allowed):
            assert servos.exchange(hold(first)).missing[3]
        with pytest.raises(ServoTimeout, match=f"no feedback for {allowed + 1} cycles") as caught:
            servos.exchange(hold(first))
        assert caught.value.joint == settings("prbt").drives[3].joint
        servos.close()
