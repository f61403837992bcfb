"""The constants of the servo loops, by their effect on an arm of one joint."""

import math
from dataclasses import replace

import numpy as np
import pytest

from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantJoint, PlantSpec, PlantVariant, RigidBody

pytest.importorskip("mujoco")

INERTIA_KG_M2, LOAD_NM = 3.4, 10.0 * 9.81 * 0.3


def plant(tilt_rad=0.0, variant=PlantVariant.NORMATIVE, payload=None, **changes):
    """A joint that carries 10 kg at 0.3 m if tilted by a right angle, without friction, under power."""
    pose = np.eye(4)
    pose[1:3, 1:3] = [[math.cos(tilt_rad), -math.sin(tilt_rad)], [math.sin(tilt_rad), math.cos(tilt_rad)]]
    joint = PlantJoint(
        name="joint", placement=pose, axis=np.array([0.0, 0.0, 1.0]),
        link=RigidBody(10.0, np.array([0.3, 0.0, 0.0]), np.diag([0.1, 0.5, 0.5])),
        coulomb_nm=0.0, viscous_nm_s_rad=0.0, stribeck_nm=0.0, stribeck_velocity_rad_s=0.02, load_friction=0.0,
        reflected_rotor_inertia_kg_m2=2.0, gear_ratio=100.0, torque_ripple_nm=0.0, ripple_per_motor_turn=2.0,
        torque_noise_nm=0.0, max_torque_nm=500.0, has_brake=True,
    )  # fmt: skip
    spec = PlantSpec(
        (replace(joint, **changes),), np.eye(4), np.array([0.0, 0.0, -9.81]), np.eye(1), np.zeros(1), 7,
        payload=payload, variant=variant,
    )  # fmt: skip
    made = ArmPlant(spec)
    made.set_powered(0, True)
    return made


def torque_after(made, time_s):
    made.advance(made.time_s + time_s)
    return float(made.sample(0.004).axis_torque_nm[0])


def test_the_arm_lags_by_the_inverse_of_the_position_gain():
    made = plant()
    made.set_target(0, 1.0, 2.0)
    made.advance(1.5)
    now = made.sample(0.004)
    assert now.axis_demand_rad[0] - now.axis_position_rad[0] == pytest.approx(0.5 / 25.0, rel=0.01)


def test_an_error_of_the_speed_is_answered_at_40_hz_and_once_more_in_each_20_ms():
    """A body that cannot be moved shows K_v K_p e (1 + t / T_i), K_v = 2 pi 40 Hz I."""
    made = plant(payload=RigidBody(1.0, np.zeros(3), np.eye(3) * 1e9))
    made.set_target(0, 1e-3, 0.0)
    proportional_nm = 2.0 * math.pi * 40.0 * INERTIA_KG_M2 * 25.0 * 1e-3
    assert torque_after(made, 0.001) == pytest.approx(proportional_nm, rel=1e-6)
    assert torque_after(made, 0.020) == pytest.approx(2.0 * proportional_nm, rel=1e-6)


def test_a_brake_closes_in_50_ms():
    made = plant(math.pi / 2.0)
    made.hold_by_brake(0)
    torque_nm = [torque_after(made, 0.001) for _ in range(60)]
    assert [value > 0.5 * LOAD_NM for value in torque_nm] == [True] * 50 + [False] * 10


@pytest.mark.parametrize(("speed_rad_s", "loss"), [(0.2, 1.0 / 0.85 - 1.0), (-0.2, -(1.0 - 0.75))])
def test_a_harsh_gear_loses_a_part_of_what_it_carries(speed_rad_s, loss):
    """The motor drives the load at 85 %, and the load the motor at 75 %."""
    made = plant(math.pi / 2.0, PlantVariant.HARSH)
    made.set_target(0, speed_rad_s, 1.0)
    torque_nm = np.mean([torque_after(made, 0.001 if row else 0.5) for row in range(100)])
    carried_nm = float(made.sample(0.004).link_torque_nm[0])
    assert torque_nm / carried_nm - 1.0 == pytest.approx(loss, abs=0.02)


@pytest.mark.parametrize(("speed_rad_s", "diverged"), [(99.0, False), (101.0, True)])
def test_a_joint_that_turns_at_a_hundred_radians_per_second_has_diverged(speed_rad_s, diverged):
    made = plant(has_brake=False)
    made.set_powered(0, False)
    made._velocity[0] = speed_rad_s
    if diverged:
        with pytest.raises(SimulationError, match="joint turns at 1"):
            made.advance(0.002)
    else:
        made.advance(0.002)
