"""The simulated arm compared with Pinocchio and with every statement of its specification."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.config.robot import load_robot
from armload_core import kernels
from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation import mujoco_model
from armload_drivers.simulation.mujoco_model import build_model, load_mujoco
from armload_drivers.simulation.mujoco_plant import ArmPlant, PlantSample
from armload_drivers.simulation.plant_interface import EncoderFault
from armload_drivers.simulation.plant_spec import PlantJoint, PlantSpec, PlantVariant, RigidBody, ScheduledPayload
from armload_identification.float_array import FloatArray

pytest.importorskip("mujoco")

GRAVITY = 9.81
CYCLE_S = 0.004
FRICTION = {"coulomb_nm": 20.0, "viscous_nm_s_rad": 30.0, "stribeck_nm": 6.0, "load_friction": 0.085}


def turned_x(angle: float) -> FloatArray:
    """Pose (4, 4) rotated about x."""
    pose = np.eye(4)
    pose[1:3, 1:3] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return pose


def joint(**changes: object) -> PlantJoint:
    """A joint with vertical axis and its link along x, without friction, ripple or noise."""
    plain = PlantJoint(
        name="joint",
        placement=np.eye(4),
        axis=np.array([0.0, 0.0, 1.0]),
        link=RigidBody(10.0, np.array([0.3, 0.0, 0.0]), np.diag([0.1, 0.5, 0.5])),
        coulomb_nm=0.0,
        viscous_nm_s_rad=0.0,
        stribeck_nm=0.0,
        stribeck_velocity_rad_s=0.02,
        load_friction=0.0,
        reflected_rotor_inertia_kg_m2=2.0,
        gear_ratio=100.0,
        torque_ripple_nm=0.0,
        ripple_per_motor_turn=2.0,
        torque_noise_nm=0.0,
        max_torque_nm=500.0,
        has_brake=True,
    )
    return replace(plain, **changes)  # type: ignore[arg-type]


def lifting(**changes: object) -> PlantJoint:
    """The same with horizontal axis: at zero, the joint carries 10 kg at 0.3 m."""
    return joint(placement=turned_x(math.pi / 2.0), **changes)


def arm(*joints: PlantJoint, **changes: object) -> PlantSpec:
    """An upright arm of the given joints."""
    n = len(joints)
    plain = PlantSpec(
        joints=joints,
        flange=np.eye(4),
        gravity_m_s2=np.array([0.0, 0.0, -GRAVITY]),
        coupling=np.eye(n),
        start_position_rad=np.zeros(n),
        seed=7,
    )
    return replace(plain, **changes)  # type: ignore[arg-type]


def random_arm(seed: int, n: int = 5) -> PlantSpec:
    """Skew axes, full inertia tensors, tilted gravity, all motors coupled."""
    random = np.random.default_rng(seed)

    def pose() -> FloatArray:
        result = np.eye(4)
        rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
        result[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
        result[:3, 3] = random.uniform(-0.5, 0.5, 3)
        return result

    def body() -> RigidBody:
        points, masses = random.normal(size=(8, 3)) * 0.2, random.uniform(0.1, 1.0, 8)
        center = masses @ points / masses.sum()
        arms = points - center
        inertia = sum(
            mass * (arm @ arm * np.eye(3) - np.outer(arm, arm)) for mass, arm in zip(masses, arms, strict=True)
        )
        return RigidBody(float(masses.sum()), center, np.asarray(inertia))

    joints = []
    for i in range(n):
        axis = random.normal(size=3)
        joints.append(
            joint(
                name=f"joint {i}",
                placement=pose(),
                axis=axis / np.linalg.norm(axis),
                link=body(),
                reflected_rotor_inertia_kg_m2=float(random.uniform(0.1, 2.0)),
            )
        )
    return arm(
        *joints,
        flange=pose(),
        payload=body(),
        coupling=np.eye(n) + random.uniform(-0.2, 0.2, (n, n)),
        gravity_m_s2=random.normal(size=3) * 5.0,
    )


def shipped(name: str) -> PlantSpec:
    """A shipped robot with its payload."""
    robot = load_robot(name)
    return robot.simulation.plant_spec(robot.simulation.payload_name)


def pinocchio_model(spec: PlantSpec) -> pin.Model:
    """The same links and payload, built independently."""
    model = pin.Model()
    model.gravity = pin.Motion(spec.gravity_m_s2, np.zeros(3))
    parent = 0
    for i, each in enumerate(spec.joints):
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(each.axis), pin.SE3(each.placement), f"q{i}")
        model.appendBodyToJoint(parent, pin_inertia(each.link), pin.SE3.Identity())
    if spec.payload is not None:
        model.appendBodyToJoint(parent, pin_inertia(spec.payload), pin.SE3(spec.flange))
    return model


def pin_inertia(body: RigidBody) -> pin.Inertia:
    return pin.Inertia(body.mass_kg, body.center_of_mass_m, body.inertia_kg_m2)


def gravity_torque(spec: PlantSpec, position_rad: FloatArray) -> FloatArray:
    """Torque (n,) that holds links and payload against gravity."""
    model = pinocchio_model(spec)
    return np.asarray(pin.computeGeneralizedGravity(model, model.createData(), position_rad))


def frictionless(spec: PlantSpec) -> PlantSpec:
    """The same arm without friction, ripple and noise."""
    return replace(
        spec,
        joints=tuple(
            replace(
                each,
                coulomb_nm=0.0,
                viscous_nm_s_rad=0.0,
                stribeck_nm=0.0,
                load_friction=0.0,
                torque_ripple_nm=0.0,
                torque_noise_nm=0.0,
            )
            for each in spec.joints
        ),
    )


def powered(spec: PlantSpec) -> ArmPlant:
    plant = ArmPlant(spec)
    for axis in range(plant.n):
        plant.set_powered(axis, True)
    return plant


def after(plant: ArmPlant, duration_s: float) -> PlantSample:
    """Sample after a time."""
    plant.advance(plant.time_s + duration_s)
    return plant.sample(CYCLE_S)


def sweep(spec: PlantSpec, speed_rad_s: float, settle_s: float, measure_s: float) -> list[PlantSample]:
    """Samples every millisecond while the first axis, initially at rest, moves at constant speed."""
    plant = powered(spec)
    duration_s = settle_s + measure_s
    plant.set_target(0, plant.hold_position(0) + speed_rad_s * duration_s, duration_s)
    plant.advance(settle_s)
    return [after(plant, 0.001) for _ in range(round(measure_s * 1000.0))]


class TestMechanics:
    @pytest.mark.parametrize("name", ["er50", "prbt", "random 1", "random 2"])
    def test_equations_of_motion_are_pinocchios(self, name: str) -> None:
        spec = frictionless(random_arm(int(name[-1])) if name.startswith("random") else shipped(name))
        built = build_model(spec)
        model, data, n = built.model, built.data, len(spec.joints)
        reference = pinocchio_model(spec)
        work = reference.createData()
        to_axis = np.linalg.inv(spec.coupling)
        rotors = np.diag([each.reflected_rotor_inertia_kg_m2 for each in spec.joints])
        random = np.random.default_rng(5)
        model.dof_frictionloss[:] = 0.0
        for _ in range(20):
            q, dq, torque = random.uniform(-2, 2, n), random.uniform(-2, 2, n), random.uniform(-50, 50, n)
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, dq, torque
            built.mujoco.mj_forward(model, data)
            inertia = np.zeros((n, n))
            built.mujoco.mj_fullM(model, data, inertia)

            expected = pin.crba(reference, work, q)
            expected = np.triu(expected) + np.triu(expected, 1).T + to_axis.T @ rotors @ to_axis
            bias = pin.nle(reference, work, q, dq)
            np.testing.assert_allclose(inertia, expected, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(data.qfrc_bias, bias, rtol=1e-9, atol=1e-8)
            np.testing.assert_allclose(data.qacc, np.linalg.solve(expected, torque - bias), rtol=1e-7, atol=1e-7)

    def test_link_torque_of_a_motion_is_pinocchios(self) -> None:
        spec = frictionless(shipped("er50"))
        plant = powered(spec)
        for axis in range(plant.n):
            plant.set_target(axis, plant.hold_position(axis) + 0.3, 1.0)
        before = after(plant, 0.499)
        now = after(plant, 0.001)
        acceleration = (now.joint_velocity_rad_s - before.joint_velocity_rad_s) / 0.001
        model = pinocchio_model(spec)
        expected = pin.rnea(model, model.createData(), now.joint_position_rad, now.joint_velocity_rad_s, acceleration)
        np.testing.assert_allclose(now.link_torque_nm, expected, rtol=0.01, atol=0.5)

    def test_frictionless_swing_keeps_its_energy(self) -> None:
        plant = ArmPlant(
            arm(lifting(has_brake=False, reflected_rotor_inertia_kg_m2=1e-6), start_position_rad=np.array([-0.5]))
        )
        inertia = 0.5 + 10.0 * 0.3**2
        energies = []
        for _ in range(100):
            now = after(plant, 0.02)
            height = 0.3 * math.sin(now.joint_position_rad[0])
            energies.append(0.5 * inertia * now.joint_velocity_rad_s[0] ** 2 + 10.0 * GRAVITY * height)
        assert max(energies) - min(energies) < 0.02 * 10.0 * GRAVITY * 0.3


class TestHolding:
    @pytest.mark.parametrize("name", ["er50", "prbt"])
    def test_holding_torque_is_gravity_within_friction(self, name: str) -> None:
        spec = replace(shipped(name), start_position_rad=np.array([0.3, 0.4, -0.3, 0.5, 0.6, -0.4]))
        quiet = replace(spec, joints=tuple(replace(each, torque_noise_nm=0.0) for each in spec.joints))
        held = after(powered(quiet), 1.0)
        gravity = gravity_torque(spec, spec.start_position_rad)
        friction = np.array(
            [
                each.coulomb_nm + each.stribeck_nm + each.torque_ripple_nm + each.load_friction * abs(load)
                for each, load in zip(spec.joints, gravity, strict=True)
            ]
        )
        at_joints = np.linalg.solve(spec.coupling.T, held.axis_torque_nm)
        assert np.all(np.abs(at_joints - gravity) <= friction)
        np.testing.assert_allclose(held.link_torque_nm, gravity, rtol=1e-3, atol=1e-2)

    def test_coupled_axis_torque_is_gravity_through_the_coupling(self) -> None:
        spec = frictionless(replace(shipped("er50"), start_position_rad=np.full(6, 0.4)))
        held = after(powered(spec), 1.0)
        expected = spec.coupling.T @ gravity_torque(spec, spec.start_position_rad)
        np.testing.assert_allclose(held.axis_torque_nm, expected, rtol=1e-4, atol=1e-3)

    def test_payload_adds_its_own_gravity_torque(self) -> None:
        loaded = frictionless(replace(shipped("prbt"), start_position_rad=np.full(6, 0.5)))
        empty = replace(loaded, payload=None)
        difference = after(powered(loaded), 1.0).axis_torque_nm - after(powered(empty), 1.0).axis_torque_nm
        expected = gravity_torque(loaded, loaded.start_position_rad) - gravity_torque(empty, loaded.start_position_rad)
        assert np.abs(expected).max() > 3.0
        np.testing.assert_allclose(difference, expected, rtol=1e-3, atol=1e-3)

    @pytest.mark.parametrize("variant", PlantVariant)
    def test_brake_holds_without_power(self, variant: PlantVariant) -> None:
        plant = ArmPlant(replace(shipped("er50"), variant=variant))
        begin = plant.sample(CYCLE_S)
        end = after(plant, 2.0)
        assert np.abs(end.joint_position_rad - begin.joint_position_rad).max() < 1e-5
        assert np.all(end.joint_torque_nm - 0.0 <= [6.0, 8.0, 5.0, 0.8, 0.6, 0.4])

    def test_without_a_brake_the_arm_falls(self) -> None:
        falling = ArmPlant(arm(lifting(has_brake=False)))
        inertia = 0.5 + 10.0 * 0.3**2 + 2.0
        end = after(falling, 0.1)
        assert end.joint_position_rad[0] == pytest.approx(-0.5 * (10.0 * GRAVITY * 0.3 / inertia) * 0.1**2, rel=0.02)

    @pytest.mark.parametrize("variant", PlantVariant)
    def test_power_on_is_bumpless(self, variant: PlantVariant) -> None:
        spec = replace(frictionless(shipped("er50")), variant=variant)
        plant = ArmPlant(spec)
        begin = after(plant, 0.2).joint_position_rad
        for axis in range(plant.n):
            plant.set_powered(axis, True)
        moved = max(np.abs(after(plant, 0.001).joint_position_rad - begin).max() for _ in range(300))
        assert moved < 1e-4

    def test_power_on_after_power_off_in_motion_holds_where_it_is(self) -> None:
        plant = powered(shipped("er50"))
        plant.set_target(0, 1.0, 1.0)
        after(plant, 0.5)
        plant.set_powered(0, False)
        stopped = after(plant, 0.5).axis_position_rad[0]
        plant.set_powered(0, True)
        assert plant.sample(CYCLE_S).axis_demand_rad[0] == pytest.approx(stopped, abs=1e-12)
        assert after(plant, 0.5).axis_position_rad[0] == pytest.approx(stopped, abs=1e-3)

    @pytest.mark.parametrize(("has_brake", "ends_s"), [(True, 0.05), (False, 0.0)])
    def test_an_axis_left_to_its_brake_has_torque_until_it_holds(self, has_brake: bool, ends_s: float) -> None:
        plant = powered(arm(lifting(has_brake=has_brake)))
        begun = after(plant, 0.2)
        plant.hold_by_brake(0)
        torque = np.array([after(plant, 0.001).joint_torque_nm[0] for _ in range(100)])
        held = 10.0 * GRAVITY * 0.3
        assert np.flatnonzero(torque < 0.5 * held)[0] == pytest.approx(1000.0 * ends_s, abs=1.0)
        moved = plant.sample(CYCLE_S).joint_position_rad[0] - begun.joint_position_rad[0]
        assert abs(moved) < 1e-5 if has_brake else moved < -0.02

    def test_a_brake_that_is_kept_closed_holds_against_the_motor_until_it_is_released(self) -> None:
        plant = ArmPlant(arm(joint()))
        plant.keep_braked(0, True)
        plant.set_powered(0, True)
        plant.set_torque_offset(0, 100.0)
        assert abs(after(plant, 0.3).joint_position_rad[0]) < 1e-5
        plant.keep_braked(0, False)
        plant.keep_braked(0, False)
        assert after(plant, 0.05).joint_position_rad[0] > 1e-5
        plant.set_powered(0, False)
        stopped = after(plant, 0.3).joint_position_rad[0]
        plant.keep_braked(0, True)
        plant.keep_braked(0, False)
        assert after(plant, 0.1).joint_position_rad[0] == pytest.approx(stopped, abs=1e-6), (
            "without power it stays closed"
        )


class TestFriction:
    @pytest.mark.parametrize("scale", [1.0, 1.03])
    @pytest.mark.parametrize("speed", [0.005, 0.03, 0.5, 1.5, -0.03, -1.5])
    def test_unloaded_joint(self, speed: float, scale: float) -> None:
        spec = arm(joint(**FRICTION), friction_scale=scale)
        torque = np.mean([now.axis_torque_nm[0] for now in sweep(spec, speed, 0.5, 0.1)])
        expected = scale * (20.0 + 30.0 * abs(speed) + 6.0 * math.exp(-((speed / 0.02) ** 2)))
        assert torque == pytest.approx(math.copysign(expected, speed), rel=0.01)

    @pytest.mark.parametrize("speed", [0.5, -0.5])
    def test_loaded_joint(self, speed: float) -> None:
        spec = arm(lifting(**FRICTION), start_position_rad=np.array([-0.3 * np.sign(speed)]))
        for now in sweep(spec, speed, 0.6, 0.1):
            load = now.link_torque_nm[0]
            assert load == pytest.approx(10.0 * GRAVITY * 0.3 * math.cos(now.joint_position_rad[0]), rel=0.01)
            expected = math.copysign(20.0 + 30.0 * 0.5 + 0.085 * abs(load), speed)
            assert now.axis_torque_nm[0] - load == pytest.approx(expected, rel=0.01)

    @pytest.mark.parametrize(("speed", "loss"), [(0.5, 1.0 / 0.85 - 1.0), (-0.5, 1.0 - 0.75)])
    def test_gear_efficiency_replaces_load_friction(self, speed: float, loss: float) -> None:
        spec = arm(
            lifting(**FRICTION),
            start_position_rad=np.array([-0.3 * np.sign(speed)]),
            variant=PlantVariant.HARSH,
        )
        excess = np.mean([now.axis_torque_nm[0] - now.link_torque_nm[0] for now in sweep(spec, speed, 0.6, 0.1)])
        load = 10.0 * GRAVITY * 0.3
        assert excess == pytest.approx(math.copysign(20.0 + 30.0 * 0.5 + loss * load, speed), rel=0.01)

    def test_joint_sticks_below_static_friction_and_slips_above(self) -> None:
        def moved(offset_nm: float) -> float:
            spec = arm(joint(coulomb_nm=20.0, stribeck_nm=6.0, torque_ripple_nm=offset_nm, has_brake=False))
            # Without power, the ripple is the only torque; at this position it is greatest.
            crest = replace(spec, start_position_rad=np.array([math.pi / 2.0 / 200.0]))
            plant = ArmPlant(crest)
            return abs(after(plant, 0.05).joint_position_rad[0] - crest.start_position_rad[0])

        assert moved(25.0) < 1e-6
        assert moved(27.0) > 1e-5


HEAVY = RigidBody(8.0, np.array([0.5, 0.0, 0.0]), np.diag([0.01, 0.02, 0.02]))


class TestPush:
    def test_a_push_is_carried_by_the_motor_until_it_ends(self) -> None:
        plant = powered(arm(joint()))
        force_n = np.array([0.0, 40.0, 0.0])
        plant.push(force_n)
        assert after(plant, 1.0).axis_torque_nm[0] == pytest.approx(-0.3 * force_n[1], rel=0.01)
        plant.mount(RigidBody(1e-6, np.zeros(3), 1e-9 * np.eye(3)))
        plant.push(np.zeros(3))
        assert abs(after(plant, 1.0).axis_torque_nm[0]) < 0.2


class TestPayloadThatChanges:
    def test_from_then_on_it_is_the_arm_with_that_payload(self) -> None:
        spec = arm(lifting(**FRICTION), changes=(ScheduledPayload(0.5, HEAVY), ScheduledPayload(1.5, None)))
        plant = powered(spec)
        plant.sample(CYCLE_S)
        plant.set_target(0, 1.0, 2.0)
        before, mounted = after(plant, 0.499), after(plant, 0.001)
        assert mounted.joint_velocity_rad_s == pytest.approx(before.joint_velocity_rad_s, abs=2e-3), "it goes on"
        assert mounted.joint_velocity_rad_s[0] > 0.4
        carried = after(plant, 0.5)
        again = after(plant, 0.6)
        for now, moment_kg_m in ((carried, 10.0 * 0.3 + 8.0 * 0.5), (again, 10.0 * 0.3)):
            expected = moment_kg_m * GRAVITY * math.cos(now.joint_position_rad[0])
            assert now.link_torque_nm[0] == pytest.approx(expected, rel=0.02)

    def test_times_count_from_the_first_sync(self) -> None:
        plant = powered(arm(lifting(), changes=(ScheduledPayload(0.5, HEAVY),)))
        plant.advance(3.0)
        weights = [after(plant, 0.1).link_torque_nm[0] for _ in range(8)]
        assert weights[4] == pytest.approx(3.0 * GRAVITY, rel=1e-3), "0.4 s after it"
        assert weights[5] > 4.0 * GRAVITY, "it has just been mounted"
        assert weights[7] == pytest.approx(7.0 * GRAVITY, rel=1e-2)

    @pytest.mark.parametrize("variant", PlantVariant)
    def test_mounting_what_is_mounted_changes_nothing(self, variant: PlantVariant) -> None:
        spec = replace(shipped("er50"), variant=variant)
        one, other = powered(spec), powered(spec)
        for plant in (one, other):
            plant.set_target(1, plant.hold_position(1) + 0.3, 1.0)
            plant.advance(0.5)
        other.mount(spec.payload)
        for _ in range(20):
            first, second = after(one, 0.01), after(other, 0.01)
            np.testing.assert_allclose(second.joint_position_rad, first.joint_position_rad, atol=1e-6)
            np.testing.assert_allclose(second.axis_torque_nm, first.axis_torque_nm, atol=0.1)

    def test_an_arm_without_power_keeps_its_brakes(self) -> None:
        plant = ArmPlant(arm(lifting(), start_position_rad=np.array([0.4])))
        plant.mount(HEAVY)
        assert after(plant, 1.0).joint_position_rad[0] == pytest.approx(0.4, abs=1e-5)


class TestElasticJoints:
    @pytest.mark.parametrize(("index", "frequency_hz"), [(0, 12.0), (3, 25.0)])
    def test_natural_frequency_against_the_locked_motor(self, index: int, frequency_hz: float) -> None:
        heavy = joint(link=RigidBody(1.0, np.zeros(3), np.eye(3) * 1e4), reflected_rotor_inertia_kg_m2=1e3)
        light = joint(link=RigidBody(5.0, np.zeros(3), np.eye(3) * 3.0), reflected_rotor_inertia_kg_m2=1.0)
        spec = arm(*[heavy] * index, light, variant=PlantVariant.HARSH)
        plant = ArmPlant(spec)
        plant._data.qpos[2 * index + 1] = 0.01
        # MuJoCo's implicit step with h = 1 ms lowers the frequency of a damped swing by under 2 %.
        swing = np.array([after(plant, 0.001).joint_position_rad[index] for _ in range(400)])
        rising = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
        crossings = rising - swing[rising] / (swing[rising + 1] - swing[rising])
        assert len(crossings) > 3
        assert 1000.0 / np.mean(np.diff(crossings)) == pytest.approx(frequency_hz, rel=0.02)

    def test_springs_are_laid_out_for_the_rated_payload_whatever_is_mounted(self) -> None:
        weight = RigidBody(10.0, np.array([0.8, 0.0, 0.0]), np.eye(3) * 0.2)
        empty = arm(lifting(), variant=PlantVariant.HARSH, rated_payload=weight)
        stiffness = (2.0 * math.pi * 12.0) ** 2 * (0.5 + 10.0 * 0.3**2 + 0.2 + 10.0 * 0.8**2)
        for spec in (empty, replace(empty, payload=weight)):
            held = after(powered(spec), 0.5)
            deflection = held.joint_position_rad[0] - held.axis_position_rad[0]
            assert deflection == pytest.approx(-held.link_torque_nm[0] / stiffness, rel=0.01)

    def test_encoder_sits_on_the_motor(self) -> None:
        held = after(powered(arm(lifting(), variant=PlantVariant.HARSH)), 0.5)
        stiffness = (2.0 * math.pi * 12.0) ** 2 * (0.5 + 10.0 * 0.3**2)
        deflection = held.joint_position_rad[0] - held.axis_position_rad[0]
        assert deflection == pytest.approx(-10.0 * GRAVITY * 0.3 / stiffness, rel=0.01)

    @pytest.mark.parametrize("name", ["er50", "prbt"])
    def test_shipped_robots_stay_stable_without_friction(self, name: str) -> None:
        plant = powered(replace(frictionless(shipped(name)), variant=PlantVariant.HARSH))
        for axis in range(plant.n):
            plant.set_target(axis, plant.hold_position(axis) + 0.2, 0.5)

        def ringing() -> float:
            return max(float(np.abs(after(plant, 0.001).joint_velocity_rad_s).max()) for _ in range(300))

        after(plant, 0.7)
        early = ringing()
        now = after(plant, 2.0)
        assert ringing() < 0.9 * early
        np.testing.assert_allclose(now.axis_position_rad, now.axis_demand_rad, atol=2e-3)


class TestServo:
    def test_position_gain_shows_as_lag(self) -> None:
        now = sweep(arm(joint()), 0.5, 1.0, 0.01)[-1]
        assert now.axis_demand_rad[0] - now.axis_position_rad[0] == pytest.approx(0.5 / 25.0, rel=0.01)

    def test_velocity_gain_and_integral_time(self) -> None:
        # A payload too heavy to move shows the controller only: K_v K_p e (1 + t / T_i).
        wall = RigidBody(1.0, np.zeros(3), np.eye(3) * 1e9)
        plant = powered(arm(joint(), payload=wall))
        plant.set_target(0, 1e-3, 0.0)
        inertia = 0.5 + 10.0 * 0.3**2 + 2.0
        proportional = 2.0 * math.pi * 40.0 * inertia * 25.0 * 1e-3
        assert after(plant, 0.001).axis_torque_nm[0] == pytest.approx(proportional, rel=1e-6)
        assert after(plant, 0.020).axis_torque_nm[0] == pytest.approx(2.0 * proportional, rel=1e-6)

    def test_velocity_gain_follows_the_nominal_inertia_not_the_upright_pose(self) -> None:
        # Two upright links have almost no inertia about the first axis; stretched out they have a lot.
        upright = RigidBody(10.0, np.array([0.0, 0.0, 0.5]), np.eye(3) * 0.01)
        spec = arm(joint(link=upright), joint(link=upright, placement=turned_x(0.0), axis=np.array([1.0, 0, 0])))
        inertia = build_model(spec).axis_inertia_kg_m2[0]
        assert inertia == pytest.approx(2.0 + 0.02 + 2.0 / 3.0 * 10.0 * 0.5**2)

    def test_target_is_interpolated_over_the_cycle_and_held(self) -> None:
        plant = powered(arm(joint()))
        plant.set_target(0, 0.1, 0.010)
        demands = [after(plant, 0.005).axis_demand_rad[0] for _ in range(4)]
        np.testing.assert_allclose(demands, [0.05, 0.1, 0.1, 0.1], atol=1e-12)

    def test_new_target_continues_from_the_present_setpoint(self) -> None:
        plant = powered(arm(joint()))
        plant.set_target(0, 0.1, 0.010)
        after(plant, 0.005)
        plant.set_target(0, 0.0, 0.010)
        assert after(plant, 0.0).axis_demand_rad[0] == pytest.approx(0.05)
        assert after(plant, 0.005).axis_demand_rad[0] == pytest.approx(0.025)

    def test_slowing_down_is_even_and_without_a_jump_of_speed(self) -> None:
        plant = powered(arm(joint()))
        for k in range(1, 6):
            plant.set_target(0, 0.004 * k, CYCLE_S)
            plant.advance(k * CYCLE_S)
        plant.slow_down(0, 0.1)
        demand = np.array([plant.sample(CYCLE_S).axis_demand_rad[0]])
        demand = np.append(demand, [after(plant, 0.01).axis_demand_rad[0] for _ in range(12)])
        speed = np.diff(demand) / 0.01
        np.testing.assert_allclose(speed, [*np.arange(0.95, 0.0, -0.1), 0.0, 0.0], atol=1e-9)

    def test_slowing_down_twice_stops_as_well(self) -> None:
        plant = powered(arm(joint()))
        plant.set_target(0, 1.0, 1.0)
        after(plant, 0.5)
        plant.slow_down(0, 0.2)
        after(plant, 0.1)
        plant.slow_down(0, 0.1)
        end = after(plant, 0.2).axis_demand_rad[0]
        assert end == pytest.approx(0.5 + 0.075 + 0.5 * 0.5 * 0.1)

    def test_slowing_down_at_rest_stays(self) -> None:
        plant = powered(arm(joint()))
        plant.set_target(0, 0.1, 0.1)
        after(plant, 0.2)
        plant.slow_down(0, 0.2)
        assert after(plant, 0.5).axis_demand_rad[0] == pytest.approx(0.1)

    def test_torque_is_limited_and_the_integrator_does_not_wind_up(self) -> None:
        wall = RigidBody(1.0, np.zeros(3), np.eye(3) * 1e9)
        plant = powered(arm(joint(max_torque_nm=5.0), payload=wall))
        plant.set_target(0, 0.1, 0.0)
        assert after(plant, 1.0).axis_torque_nm[0] == pytest.approx(5.0)
        plant.set_target(0, -0.1, 0.0)
        assert after(plant, 0.001).axis_torque_nm[0] == pytest.approx(-5.0)

    def test_torque_offset_takes_over_from_the_servo(self) -> None:
        spec = arm(lifting())
        load = 10.0 * GRAVITY * 0.3
        without, helped = powered(spec), powered(spec)
        helped.set_torque_offset(0, load)
        # Acts from the next step on, in addition to the servo's torque ...
        assert after(helped, 0.001).axis_torque_nm[0] == pytest.approx(2.0 * load, rel=1e-3)
        # ... until the servo's part has fallen by the same amount and the sum is as before.
        held, still = after(helped, 1.0), after(without, 1.0)
        assert held.axis_torque_nm[0] == pytest.approx(still.axis_torque_nm[0], rel=1e-4)
        assert held.axis_position_rad[0] == pytest.approx(0.0, abs=1e-5)
        helped.set_torque_offset(0, 0.0)
        assert after(helped, 0.001).axis_torque_nm[0] == pytest.approx(0.0, abs=0.01 * load)

    def test_torque_offset_at_power_on_is_part_of_the_holding_torque(self) -> None:
        plant = ArmPlant(arm(lifting()))
        plant.set_torque_offset(0, 10.0)
        plant.set_powered(0, True)
        assert after(plant, 0.001).axis_torque_nm[0] == pytest.approx(10.0 * GRAVITY * 0.3, rel=1e-6)

    def test_coupled_axis_moves_the_joints_behind_it(self) -> None:
        plant = powered(replace(frictionless(shipped("er50")), start_position_rad=np.zeros(6)))
        plant.set_target(3, 1.0, 1.0)
        moved = after(plant, 2.0).joint_position_rad
        np.testing.assert_allclose(moved[3:], [1.0, 0.0167, -0.02], atol=1e-4)

    @pytest.mark.parametrize(
        ("fault", "at_once_rad", "after_s_rad"),
        [
            (EncoderFault(), 0.2, 0.2),
            (EncoderFault(jump_rad=0.1), 0.3, 0.3),
            (EncoderFault(drift_rad_s=0.05), 0.2, 0.25),
            (EncoderFault(scale=0.0, jump_rad=-0.1, drift_rad_s=0.02), 0.1, 0.12),
        ],
    )
    def test_a_failed_encoder_reports_jump_and_drift_from_then_on(self, fault, at_once_rad, after_s_rad) -> None:
        plant = ArmPlant(arm(joint(), start_position_rad=np.array([0.2])))
        plant.advance(0.5)
        plant.fail_encoder(0, fault)
        assert plant.hold_position(0) == pytest.approx(at_once_rad, abs=1e-6)
        plant.advance(1.5)
        assert plant.hold_position(0) == pytest.approx(after_s_rad, abs=1e-6)

    @pytest.mark.parametrize("scale", [-1.0, 0.0, 0.5])
    def test_a_failed_encoder_counts_by_its_scale(self, scale) -> None:
        plant = ArmPlant(arm(joint(has_brake=False), start_position_rad=np.array([0.2])))
        plant.fail_encoder(0, EncoderFault(scale=scale))
        plant._position[0] = 0.6
        assert plant.hold_position(0) == pytest.approx(0.2 + 0.4 * scale)


class TestMeasurement:
    def test_gain_error_is_not_seen_by_the_drive(self) -> None:
        held = after(powered(arm(lifting(), torque_gain_error=np.array([0.05]))), 1.0)
        load = 10.0 * GRAVITY * 0.3
        assert held.joint_torque_nm[0] == pytest.approx(load, rel=1e-4)
        assert held.axis_torque_nm[0] == pytest.approx(load / 1.05, rel=1e-4)

    def test_gain_drifts(self) -> None:
        plant = powered(arm(lifting(), torque_gain_drift_per_s=np.array([0.01])))
        load = 10.0 * GRAVITY * 0.3
        assert after(plant, 1.0).axis_torque_nm[0] == pytest.approx(load / 1.01, rel=1e-3)
        assert after(plant, 4.0).axis_torque_nm[0] == pytest.approx(load / 1.05, rel=1e-3)

    def test_ripple_is_in_the_motor_and_not_in_the_reported_torque(self) -> None:
        samples = sweep(arm(joint(torque_ripple_nm=8.0)), 0.3, 0.5, 0.5)
        ripple = np.array([now.joint_torque_nm[0] - now.axis_torque_nm[0] for now in samples])
        position = np.array([now.axis_position_rad[0] for now in samples])
        # The torque is held from one millisecond before the sample: at most 0.3 * 200 * 1e-3 rad of phase.
        np.testing.assert_allclose(ripple, 8.0 * np.sin(200.0 * position), atol=8.0 * 0.09)
        assert np.ptp(ripple) == pytest.approx(16.0, rel=0.01)

    @pytest.mark.parametrize(("cycle_s", "sigma_nm"), [(0.01, 4.0), (0.004, 4.0 * math.sqrt(2.5)), (0.04, 2.0)])
    def test_noise_is_white_and_scales_with_the_rate(self, cycle_s: float, sigma_nm: float) -> None:
        plant = ArmPlant(arm(joint(torque_noise_nm=4.0)))
        noise = np.array([plant.sample(cycle_s).axis_torque_nm[0] for _ in range(20000)])
        assert np.std(noise) == pytest.approx(sigma_nm, rel=0.02)
        assert abs(np.mean(noise)) < 4.0 * sigma_nm / math.sqrt(len(noise))
        assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 0.03

    def test_equal_seeds_give_equal_arms_and_others_other_noise(self) -> None:
        def run(seed: int) -> FloatArray:
            plant = powered(replace(shipped("er50"), seed=seed))
            rows = []
            for k in range(50):
                for axis in range(plant.n):
                    plant.set_target(axis, plant.hold_position(axis) + 0.01, CYCLE_S)
                now = after(plant, CYCLE_S)
                rows.append(np.concatenate([now.joint_position_rad, now.axis_torque_nm, [k]]))
            return np.array(rows)

        first = run(3)
        np.testing.assert_array_equal(first, run(3))
        assert np.all(first[:, 6:12] != run(4)[:, 6:12])
        np.testing.assert_array_equal(first[:, :6], run(4)[:, :6])

    def test_time_is_counted_in_whole_steps_and_never_back(self) -> None:
        plant = ArmPlant(arm(joint()))
        plant.advance(0.0108)
        assert plant.time_s == pytest.approx(0.010)
        plant.advance(0.005)
        assert plant.time_s == pytest.approx(0.010)
        # 3 * 0.1 is a little less than a whole number of steps in binary.
        plant.advance(3 * 0.1)
        assert plant.time_s == pytest.approx(0.300)


class TestRefusals:
    # The paper's identified payload; no mass distribution has these moments.
    IMPOSSIBLE = RigidBody(9.323, np.zeros(3), np.diag([-3.18, -2.83, 0.13]))

    @pytest.mark.parametrize(
        ("spec", "text"),
        [
            (arm(joint(), payload=IMPOSSIBLE), "positive eigenvalues(.|\n)*payload"),
            (arm(joint(link=RigidBody(0.0, np.zeros(3), np.eye(3)))), "mass(.|\n)*link 0"),
            (arm(joint(link=RigidBody(1.0, np.zeros(3), np.diag([1.0, 1.0, 2.1])))), "A [+] B >= C(.|\n)*link 0"),
            (arm(joint(), changes=(ScheduledPayload(1.0, IMPOSSIBLE),)), "positive eigenvalues(.|\n)*payload"),
        ],
    )
    def test_arm_that_cannot_exist(self, spec: PlantSpec, text: str) -> None:
        with pytest.raises(SimulationError, match=text):
            ArmPlant(spec)

    def test_point_mass_is_possible(self) -> None:
        held = after(powered(arm(lifting(link=RigidBody(1.0, np.array([0.5, 0, 0]), np.zeros((3, 3)))))), 0.5)
        assert held.axis_torque_nm[0] == pytest.approx(0.5 * GRAVITY, rel=1e-4)

    def test_setpoints_that_are_no_numbers(self) -> None:
        plant = ArmPlant(arm(joint()))
        with pytest.raises(SimulationError, match="joint: the target nan"):
            plant.set_target(0, math.nan, CYCLE_S)
        with pytest.raises(SimulationError, match="joint: the offset inf"):
            plant.set_torque_offset(0, math.inf)

    def test_divergence_names_the_joint(self) -> None:
        plant = ArmPlant(arm(joint(name="runaway", max_torque_nm=1e6)))
        plant.set_powered(0, True)
        plant._parameter[kernels.SERVO_VELOCITY_GAIN] = 0.0
        plant.set_torque_offset(0, 1e5)
        with pytest.raises(SimulationError, match=r"diverged at 0\.\d+ s: runaway turns at"):
            plant.advance(1.0)

    def test_missing_mujoco_says_what_to_install(self) -> None:
        script = (
            "import sys; sys.modules['mujoco'] = None\n"
            "from armload_drivers.simulation.mujoco_model import load_mujoco\n"
            "from armload_drivers.driver_errors import SimulationError\n"
            "try: load_mujoco()\n"
            "except SimulationError as error: print(error)\n"
        )
        run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        assert 'pip install "armload[sim]"' in run.stdout


@pytest.mark.parametrize(("read_ns", "replaced"), [(50, False), (1990, False), (2010, True), (15_000, True)])
def test_a_clock_that_is_slow_to_read_is_replaced(monkeypatch, read_ns, replaced):
    """Only the shortest reads count: others were interrupted."""
    now_ns, clocks = iter(np.cumsum([0, 10**6, *[read_ns] * 3, *[10**6] * 100]).tolist()), []
    monkeypatch.setattr(mujoco_model.time, "monotonic_ns", lambda: next(now_ns))
    monkeypatch.setattr(pytest.importorskip("mujoco"), "set_mjcb_time", clocks.append)
    load_mujoco.__wrapped__()
    monkeypatch.undo()
    assert [clock() for clock in clocks] == [0.0] * replaced
