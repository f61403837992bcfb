"""The specification of a simulated arm, as plain data; `mujoco_plant` builds the simulation from it.

AXIS and joint are distinguished: an axis is one motor seen through its gear. Links, friction and position belong to
joints; rotor, ripple, torque limit and noise belong to axes. If motors are not coupled, the two are the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from armload_drivers.servos import FloatArray
from armload_drivers.simulation.servo_loops import BRAKE_DELAY_S, INTEGRAL_TIME_S


class PlantVariant(Enum):
    """Transmission of the simulated arm."""

    NORMATIVE = "normative"
    """Stiff gears, load-dependent friction mu |tau_link|."""
    HARSH = "harsh"
    """Elastic joints and gear efficiencies in place of mu; for reports only."""


@dataclass(frozen=True, slots=True)
class RigidBody:
    """Inertial properties of one rigid body in a given frame.

    Attributes:
        center_of_mass_m: (3,) centre of mass.
        inertia_kg_m2: (3, 3) inertia tensor about the centre of mass, along the axes of the frame; the
            elements are the tensor's, I_xy = -integral(x y dm).
    """

    mass_kg: float
    center_of_mass_m: FloatArray
    inertia_kg_m2: FloatArray


@dataclass(frozen=True, slots=True)
class ScheduledPayload:
    """A change of payload at some time, whether the arm moves or not.

    Attributes:
        time_s: Time since the drives were first sampled, that is, since the first SYNC; above 0.
        payload: Body at the flange, in the FLANGE frame; None for the empty flange.
    """

    time_s: float
    payload: RigidBody | None


@dataclass(frozen=True, slots=True)
class PlantJoint:
    """One joint with its link, its gear and its motor.

    Attributes:
        name: Name of the joint.
        placement: (4, 4) pose of the joint's frame at position zero in the previous joint's frame.
        axis: (3,) unit vector of the axis of rotation in the joint's frame.
        link: The link, in the moving joint frame; without rotor and payload.
        coulomb_nm: Coulomb friction.
        viscous_nm_s_rad: Viscous friction.
        stribeck_nm: Excess of static over Coulomb friction.
        stribeck_velocity_rad_s: Speed v_s in stribeck * exp(-(dq / v_s)^2).
        load_friction: mu, friction per torque of links and payload.
        reflected_rotor_inertia_kg_m2: Rotor inertia REFLECTED to the axis: gear ratio squared times the rotor's own.
        gear_ratio: Motor turns per axis turn.
        torque_ripple_nm: Amplitude of the torque ripple at the axis.
        ripple_per_motor_turn: Ripple periods per motor turn.
        torque_noise_nm: Standard deviation of one raw torque sample at 100 Hz, at the axis.
        max_torque_nm: Greatest torque of the drive, at the axis.
        has_brake: Whether a brake holds the axis while its drive is off.
        brake_torque_nm: Friction of the engaged brake, at the axis; None for `max_torque_nm`.
        brake_delay_s: Time from engaging the brake until it holds.
    """

    name: str
    placement: FloatArray
    axis: FloatArray
    link: RigidBody
    coulomb_nm: float
    viscous_nm_s_rad: float
    stribeck_nm: float
    stribeck_velocity_rad_s: float
    load_friction: float
    reflected_rotor_inertia_kg_m2: float
    gear_ratio: float
    torque_ripple_nm: float
    ripple_per_motor_turn: float
    torque_noise_nm: float
    max_torque_nm: float
    has_brake: bool
    brake_torque_nm: float | None = None
    brake_delay_s: float = BRAKE_DELAY_S


@dataclass(frozen=True, slots=True)
class PlantSpec:
    """A simulated arm with its payload.

    Attributes:
        joints: n joints from the base to the flange.
        flange: (4, 4) pose of the flange in the last joint's frame.
        gravity_m_s2: (3,) gravitational acceleration in the base frame, (0, 0, -9.81) for an upright arm.
        coupling: (n, n) C with q_joint = C q_axis and tau_joint = C^-T tau_axis.
        start_position_rad: (n,) joint positions at time zero; the arm stands still.
        seed: Seed of the measurement noise.
        payload: Body at the flange, in the FLANGE frame; None for the empty flange.
        changes: Payloads mounted and removed later, in order of time.
        variant: Transmission; `PlantVariant`.
        rated_payload: Body in the flange frame for which the elastic joints' natural frequencies are defined, whatever
            is mounted; None for the empty flange.
        friction_scale: Factor on Coulomb, Stribeck, viscous and load-dependent friction.
        torque_gain_error: (n,) e per axis; the motor produces (1 + e) times the drive's nominal, reported torque. None
            for zero.
        torque_gain_drift_per_s: (n,) growth of e per second; None for zero.
        integral_time_s: T_i of the velocity loops; inf for loops without an integral part.
    """

    joints: tuple[PlantJoint, ...]
    flange: FloatArray
    gravity_m_s2: FloatArray
    coupling: FloatArray
    start_position_rad: FloatArray
    seed: int
    payload: RigidBody | None = None
    changes: tuple[ScheduledPayload, ...] = ()
    variant: PlantVariant = PlantVariant.NORMATIVE
    rated_payload: RigidBody | None = None
    friction_scale: float = 1.0
    torque_gain_error: FloatArray | None = None
    torque_gain_drift_per_s: FloatArray | None = None
    integral_time_s: float = INTEGRAL_TIME_S
