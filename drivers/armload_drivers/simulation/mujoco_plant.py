"""The simulated arm: MuJoCo's mechanics with one servo loop per axis, advanced to times given as arguments.

It has no clock, bus or thread. Its owner advances it, sets the setpoints that a drive would have latched, and takes
samples as a drive would at SYNC. A sample is in SI units and not quantised; the drives convert it to counts and per
mille.

The timing is that of a drive: a target latched at SYNC k is reached by linear interpolation at SYNC k + 1, one cycle of
delay. A torque offset acts from the next step on.

Two arms with the same specification and the same calls are bit-identical.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from armload_core import kernels
from armload_drivers.driver_errors import SimulationError
from armload_drivers.servos import FloatArray
from armload_drivers.simulation import servo_loops
from armload_drivers.simulation.mujoco_model import TIME_STEP_S, PlantModel, build_model
from armload_drivers.simulation.plant_interface import AxisSample, EncoderFault
from armload_drivers.simulation.plant_spec import PlantSpec, PlantVariant, RigidBody

NOISE_CYCLE_S = 0.01
"""Cycle to which the noise of a specification refers: white noise grows with the square root of the rate."""

STEP_TOLERANCE = 1e-6
"""Share of a step by which a time may precede a step and still count as that step."""


@dataclass(frozen=True, slots=True)
class PlantSample(AxisSample):
    """Measurements of the drives at one instant, and true values; the fields before the time are a measurement's rows.

    Encoders are on the motor side of elastic gears (see `ArmPlant.fail_encoder`). The drives' current sensors report
    the nominal torque plus noise: ripple and gain error arise in the motor, and only the servo's reaction to them is
    visible.

    Attributes:
        joint_position_rad: (n,) true positions, on the link side of elastic gears.
        joint_velocity_rad_s: (n,) true velocities.
        joint_torque_nm: (n,) true torque of the motors at the joints, including ripple and gain error.
        link_torque_nm: (n,) true torque that moves and carries links and payload, without rotors and friction.
        time_s: The plant's time.
    """

    joint_position_rad: FloatArray
    joint_velocity_rad_s: FloatArray
    joint_torque_nm: FloatArray
    link_torque_nm: FloatArray
    time_s: float = field(kw_only=True)


class ArmPlant:
    """A simulated arm with its servo loops, initially powered off.

    Attributes:
        n: Number of joints and axes.
    """

    def __init__(self, spec: PlantSpec) -> None:
        """Build the arm, at rest at its start position.

        Args:
            spec: The arm.

        Raises:
            SimulationError: MuJoCo is missing, or such an arm is impossible.
        """
        built = build_model(spec)
        self.n = len(spec.joints)
        self._spec = spec
        self._to_axis = np.ascontiguousarray(np.linalg.inv(spec.coupling))
        self._noise_nm = np.array([joint.torque_noise_nm for joint in spec.joints])
        self._random = np.random.default_rng(spec.seed)
        self._step = 0
        self._state = np.zeros((kernels.SERVO_STATES, self.n))
        self._state[kernels.SERVO_ENCODER_SCALE] = 1.0
        self._parameter = _parameters(spec, built.axis_inertia_kg_m2)
        self._take(built)
        # Compiled in advance: an arm in real time cannot wait for it.
        self._changes = deque(
            (round(change.time_s / TIME_STEP_S), build_model(replace(spec, payload=change.payload)))
            for change in spec.changes
        )
        self._first_sampled: int | None = None
        braked = [0.0 if joint.has_brake else math.inf for joint in spec.joints]
        self._state[kernels.SERVO_BRAKE_BEGINS] = braked
        self._kept_braked: set[int] = set()
        for axis in range(self.n):
            self.set_powered(axis, False)

    def _take(self, built: PlantModel) -> None:
        """Use this model from now on."""
        self._mujoco, self._model, self._data = built.mujoco, built.model, built.data
        self._hinges = built.hinges_per_joint
        # Views into MuJoCo's memory, which does not move
        self._position = self._data.qpos
        self._velocity = self._data.qvel
        self._link_torque = np.zeros(self._model.nv)
        self._mujoco.mj_rne(self._model, self._data, 0, self._link_torque)
        self._servos = kernels.ServoLoops(
            self._parameter,
            self._state,
            self._to_axis,
            self._position,
            self._velocity,
            self._link_torque,
            self._data.qfrc_applied,
            self._model.dof_frictionloss,
            servo_loops.GREATEST_SPEED_RAD_S,
        )

    @property
    def time_s(self) -> float:
        """Time that the arm has been advanced to, in whole steps of 1 ms."""
        return self._step * TIME_STEP_S

    def advance(self, time_s: float) -> None:
        """Advance the arm in complete steps; has no effect for a time in the past.

        Args:
            time_s: Time to advance to.

        Raises:
            SimulationError: The simulation has diverged.
        """
        steps = math.floor(time_s / TIME_STEP_S + STEP_TOLERANCE)
        while self._changes and self._first_sampled is not None:
            due = self._first_sampled + self._changes[0][0]
            if due > steps:
                break
            self._run(due)
            self._carry_on_with(self._changes.popleft()[1])
        self._run(steps)

    def _run(self, steps: int) -> None:
        """Advance to a step."""
        step_once, rne, model, data = self._mujoco.mj_step, self._mujoco.mj_rne, self._model, self._data
        close_loops = self._servos.step
        while self._step < steps:
            if not close_loops(self._step):
                self._raise_diverged()
            step_once(model, data)
            rne(model, data, 1, self._link_torque)
            self._step += 1

    def mount(self, payload: RigidBody | None) -> None:
        """Replace the body at the flange from the next step on; takes some milliseconds.

        Args:
            payload: The body in the flange frame; None for the empty flange.

        Raises:
            SimulationError: the body is physically impossible.
        """
        self._carry_on_with(build_model(replace(self._spec, payload=payload)))

    def push(self, force_n: FloatArray) -> None:
        """Push against the last link, at its centre of mass, until the next call.

        Args:
            force_n: (3,) force in the base frame; zeros end the push.
        """
        self._data.xfrc_applied[-1, :3] = force_n

    def _carry_on_with(self, built: PlantModel) -> None:
        """Continue with another model, in the same state of motion."""
        before, data = self._data, built.data
        for name in ("qpos", "qvel", "qfrc_applied"):
            getattr(data, name)[:] = getattr(before, name)
        data.xfrc_applied[-1] = before.xfrc_applied[-1]
        data.time = before.time
        built.model.dof_frictionloss[:] = self._model.dof_frictionloss
        built.mujoco.mj_forward(built.model, data)
        self._take(built)
        built.mujoco.mj_rne(built.model, data, 1, self._link_torque)

    def set_target(self, axis: int, position_rad: float, over_s: float) -> None:
        """Move an axis's setpoint linearly from its present value, then hold it.

        Args:
            axis: Index of the axis.
            position_rad: New setpoint.
            over_s: Time to reach it in; one cycle for a drive in a cyclic mode.

        Raises:
            SimulationError: The target is not a finite number.
        """
        if not math.isfinite(position_rad):
            raise SimulationError(f"{self._spec.joints[axis].name}: the target {position_rad} is not a finite position")
        self._ramp(axis, position_rad, over_s)

    def slow_down(self, axis: int, over_s: float) -> None:
        """Bring an axis's setpoint from its present speed to a stop at constant deceleration: quick stop.

        Args:
            axis: Index of the axis.
            over_s: Time to stop in.
        """
        begin, finish, first, steps, slowing = self._state[: kernels.SERVO_RAMP_SLOWING + 1, axis]
        elapsed = self._step - first
        speed = 0.0
        # A ramp that ends at this very instant still counts as motion: targets arrive at SYNC.
        if steps > 0.0 and elapsed < steps + 0.5:
            left = 1.0 - elapsed / steps
            speed = (finish - begin) / (steps * TIME_STEP_S) * (2.0 * left if slowing else 1.0)
        self._ramp(axis, self._servos.setpoint(axis, self._step) + 0.5 * speed * over_s, over_s, slowing=True)

    def set_torque_offset(self, axis: int, torque_nm: float) -> None:
        """Add a torque inside an axis's servo loop (60B2), from the next step on.

        Args:
            axis: Index of the axis.
            torque_nm: Torque at the axis.

        Raises:
            SimulationError: The torque is not a finite number.
        """
        if not math.isfinite(torque_nm):
            raise SimulationError(f"{self._spec.joints[axis].name}: the offset {torque_nm} is not a finite torque")
        self._state[kernels.SERVO_OFFSET, axis] = torque_nm

    def set_powered(self, axis: int, on: bool) -> None:
        """Switch an axis's servo loop and torque on or off.

        If off, the motor produces no torque at once, and the brake, if any, holds after its delay. If on, the setpoint
        is the present position, and the brake is released with the integrator at the torque that holds links and
        payload, as with drives that preload the motor before releasing the brake.

        Args:
            axis: Index of the axis.
            on: Whether the axis is powered.
        """
        state = self._state
        self._ramp(axis, self.hold_position(axis), 0.0)
        if on:
            state[kernels.SERVO_POWER_ENDS, axis] = math.inf
            if axis not in self._kept_braked:
                state[kernels.SERVO_BRAKE_BEGINS, axis] = math.inf
        else:
            state[kernels.SERVO_POWER_ENDS, axis] = min(state[kernels.SERVO_POWER_ENDS, axis], self._step)
            self._engage_brake(axis)
        holding = float(self._spec.coupling[:, axis] @ self._link_torque[:: self._hinges])
        holds = on and math.isfinite(self._spec.integral_time_s)
        state[kernels.SERVO_INTEGRAL, axis] = holding - state[kernels.SERVO_OFFSET, axis] if holds else 0.0
        if not on:
            state[kernels.SERVO_TORQUE, axis] = state[kernels.SERVO_TRUE_TORQUE, axis] = 0.0

    def hold_by_brake(self, axis: int) -> None:
        """Engage an axis's brake, and remove the torque when it holds, as drives do at standstill.

        Without a brake the torque is removed at once.

        Args:
            axis: Index of the axis.
        """
        if not self._spec.joints[axis].has_brake:
            self.set_powered(axis, False)
            return
        self._engage_brake(axis)
        ends, holds = self._state[[kernels.SERVO_POWER_ENDS, kernels.SERVO_BRAKE_BEGINS], axis]
        self._state[kernels.SERVO_POWER_ENDS, axis] = min(ends, holds)

    def keep_braked(self, axis: int, closed: bool) -> None:
        """Keep an axis's brake closed also while torque is on, or leave it to `set_powered` again.

        Args:
            axis: Index of the axis.
            closed: Whether it is kept closed.
        """
        if closed:
            self._kept_braked.add(axis)
            self._engage_brake(axis)
        elif axis in self._kept_braked:
            self._kept_braked.remove(axis)
            if math.isinf(self._state[kernels.SERVO_POWER_ENDS, axis]):
                self._state[kernels.SERVO_BRAKE_BEGINS, axis] = math.inf

    def _engage_brake(self, axis: int) -> None:
        """Let the brake of an axis hold after its delay, unless it already does or there is none."""
        joint, row = self._spec.joints[axis], self._state[kernels.SERVO_BRAKE_BEGINS]
        if joint.has_brake:
            row[axis] = min(row[axis], self._step + round(joint.brake_delay_s / TIME_STEP_S))

    def fail_encoder(self, axis: int, fault: EncoderFault) -> None:
        """Let an axis's encoder fail: its own loops act on what it reports from now on.

        Args:
            axis: Index of the axis.
            fault: What it reports.
        """
        scale, offset, drift = (
            self._state[row : row + 1, axis]
            for row in (kernels.SERVO_ENCODER_SCALE, kernels.SERVO_ENCODER_OFFSET, kernels.SERVO_ENCODER_DRIFT)
        )
        seen_rad, true_rad = self.hold_position(axis), float(self._to_axis[axis] @ self._position[:: self._hinges])
        scale[:], drift[:] = fault.scale, fault.drift_rad_s
        offset[:] = seen_rad + fault.jump_rad - fault.scale * true_rad - fault.drift_rad_s * self.time_s

    def hold_position(self, axis: int) -> float:
        """Present position of an axis as its encoder has it, for initialising targets.

        Args:
            axis: Index of the axis.

        Returns:
            The axis's position in rad.
        """
        return self._servos.position(axis, self._step)

    def sample(self, cycle_s: float) -> PlantSample:
        """Measure, as the drives do at SYNC; every call draws new noise.

        Args:
            cycle_s: Period of the samples; sets the noise, sigma = noise at 100 Hz * sqrt(0.01 s / cycle_s).

        Returns:
            Measurements and true values, as copies.
        """
        if self._first_sampled is None:
            self._first_sampled = self._step
        rows = np.empty((kernels.SERVO_MEASUREMENTS, self.n))
        self._servos.measure(self._step, rows)
        noise = self._noise_nm * (math.sqrt(NOISE_CYCLE_S / cycle_s) * self._random.standard_normal(self.n))
        rows[kernels.SERVO_AXIS_TORQUE] += noise
        return PlantSample(*rows, time_s=self.time_s)

    def _ramp(self, axis: int, position_rad: float, over_s: float, *, slowing: bool = False) -> None:
        """Start a ramp of an axis's setpoint to a position."""
        self._servos.ramp(axis, self._step, position_rad, over_s / TIME_STEP_S, slowing)

    def _raise_diverged(self) -> None:
        """Raise the error that names the diverged joint."""
        speed = self._velocity[:: self._hinges]
        worst = int(np.argmax(np.where(np.isfinite(speed), np.abs(speed), np.inf)))
        raise SimulationError(
            f"the simulated arm has diverged at {self.time_s:.3f} s: {self._spec.joints[worst].name} turns "
            f"at {speed[worst]:.3g} rad/s. Look for an inertia or a gear ratio that is far too small."
        )


def _parameters(spec: PlantSpec, axis_inertia_kg_m2: FloatArray) -> FloatArray:
    """The servo loops' constants (SERVO_PARAMETERS, n)."""
    n = len(spec.joints)
    velocity_gain = 2.0 * math.pi * servo_loops.VELOCITY_BANDWIDTH_HZ * axis_inertia_kg_m2
    parameter = np.zeros((kernels.SERVO_PARAMETERS, n))
    parameter[kernels.SERVO_POSITION_GAIN] = servo_loops.POSITION_GAIN_1_S
    parameter[kernels.SERVO_VELOCITY_GAIN] = velocity_gain
    parameter[kernels.SERVO_INTEGRAL_GAIN] = velocity_gain * (TIME_STEP_S / spec.integral_time_s)
    parameter[kernels.SERVO_TIME_STEP] = TIME_STEP_S
    if spec.torque_gain_error is not None:
        parameter[kernels.SERVO_GAIN_ERROR] = spec.torque_gain_error
    if spec.torque_gain_drift_per_s is not None:
        parameter[kernels.SERVO_GAIN_DRIFT] = spec.torque_gain_drift_per_s * TIME_STEP_S
    for i, joint in enumerate(spec.joints):
        parameter[kernels.SERVO_MAX_TORQUE, i] = joint.max_torque_nm
        parameter[kernels.SERVO_RIPPLE, i] = joint.torque_ripple_nm
        parameter[kernels.SERVO_RIPPLE_PER_RAD, i] = joint.ripple_per_motor_turn * joint.gear_ratio
        parameter[kernels.SERVO_COULOMB, i] = joint.coulomb_nm * spec.friction_scale
        parameter[kernels.SERVO_STRIBECK, i] = joint.stribeck_nm * spec.friction_scale
        parameter[kernels.SERVO_STRIBECK_VELOCITY, i] = joint.stribeck_velocity_rad_s
        parameter[kernels.SERVO_BRAKE, i] = (
            joint.max_torque_nm if joint.brake_torque_nm is None else joint.brake_torque_nm
        )
        if spec.variant is PlantVariant.HARSH:
            parameter[kernels.SERVO_LOSS_FORWARD, i] = 1.0 / servo_loops.EFFICIENCY_FORWARD - 1.0
            parameter[kernels.SERVO_LOSS_BACKWARD, i] = 1.0 - servo_loops.EFFICIENCY_BACKWARD
        else:
            parameter[kernels.SERVO_LOSS_FORWARD, i] = joint.load_friction * spec.friction_scale
            parameter[kernels.SERVO_LOSS_BACKWARD, i] = joint.load_friction * spec.friction_scale
    return parameter
