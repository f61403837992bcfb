"""One step of all servo loops and of the joints' friction, as a numba kernel.

The cascade of one axis, at 1 kHz:

    dq_ref = K_p (setpoint - q)                                    K_p = 25 1/s
    tau    = K_v (dq_ref - dq) + integral + torque offset          K_v = 2 pi 40 Hz * inertia
    integral' = K_v / T_i (dq_ref - dq)                            T_i = 20 ms

limited to the drive's greatest torque; the integral stands still while the limit is reached and would be
exceeded further. There is no velocity feed-forward: the arm follows with a lag of 1 / K_p. The motor gives
(1 + e) times what the drive believes, and its ripple on top.

Friction of one joint opposes the motion with

    scale (coulomb + stribeck exp(-(dq / v_s)^2) + mu |tau_link|)

and MuJoCo holds the joint at rest while that suffices; viscous friction is the model's damping. With gear
efficiencies in place of mu the loss is |tau_link| (1 / 0.85 - 1) where the motor drives the load and
|tau_link| (1 - 0.75) where the load drives the motor.

Rows of the arrays `parameter` and `state` are named below; columns are axes or joints.
"""

from __future__ import annotations

import math

from numba import njit

from armload_core.arrays import FloatArray

POSITION_GAIN_1_S = 25.0
VELOCITY_BANDWIDTH_HZ = 40.0
INTEGRAL_TIME_S = 0.020
EFFICIENCY_FORWARD = 0.85
EFFICIENCY_BACKWARD = 0.75
GREATEST_SPEED_RAD_S = 100.0
"""No joint of an arm turns as fast; a simulation in which one does has diverged."""

# Rows of `parameter`, constant.
VELOCITY_GAIN = 0
INTEGRAL_GAIN = 1  # per time step
MAX_TORQUE = 2
RIPPLE = 3
RIPPLE_PER_RAD = 4  # of the axis
GAIN_ERROR = 5
GAIN_DRIFT = 6  # per time step
COULOMB = 7
STRIBECK = 8
STRIBECK_VELOCITY = 9
LOSS_FORWARD = 10  # per |tau_link|
LOSS_BACKWARD = 11
BRAKE = 12
PARAMETERS = 13

# Rows of `state`. Those down to BRAKED are set from outside, the others by the step.
RAMP_FROM = 0
RAMP_TO = 1
RAMP_BEGIN = 2  # step number
RAMP_STEPS = 3
RAMP_SLOWING = 4  # 0 or 1
OFFSET = 5
POWERED = 6  # 0 or 1
BRAKED = 7  # 0 or 1
INTEGRAL = 8
TORQUE = 9  # of the axis, as the drive believes
TRUE_TORQUE = 10  # of the axis
STATES = 11


@njit("f8(f8[:,::1],i8,f8)", cache=True)
def setpoint(state: FloatArray, axis: int, step: float) -> float:
    """Setpoint of one axis: interpolation between two setpoints, held afterwards.

    Linear, or with a speed that falls evenly from 2 (to - from) / duration to zero.

    Args:
        state: (STATES, n) of which the rows of the ramp are read.
        axis: Index of the axis.
        step: Number of the step asked for.

    Returns:
        The setpoint in rad.
    """
    elapsed = step - state[RAMP_BEGIN, axis]
    if elapsed >= state[RAMP_STEPS, axis]:
        return float(state[RAMP_TO, axis])
    share = elapsed / state[RAMP_STEPS, axis]
    share += state[RAMP_SLOWING, axis] * share * (1.0 - share)
    return float(state[RAMP_FROM, axis] + (state[RAMP_TO, axis] - state[RAMP_FROM, axis]) * share)


@njit(
    "b1(f8[:,::1],f8[:,::1],f8[:,::1],f8[::1],f8[::1],f8[::1],f8[::1],f8[::1],i8,f8)",
    cache=True,
)
def servo_step(
    parameter: FloatArray,
    state: FloatArray,
    to_axis: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    link_torque: FloatArray,
    applied: FloatArray,
    friction: FloatArray,
    hinges: int,
    step: float,
) -> bool:
    """Close all servo loops once and set the joints' friction.

    Args:
        parameter: (PARAMETERS, n) constants.
        state: (STATES, n) setpoints and integrators; changed.
        to_axis: (n, n) C^-1, from joint to axis.
        position: (hinges n,) MuJoCo's qpos in rad.
        velocity: (hinges n,) MuJoCo's qvel in rad/s.
        link_torque: (hinges n,) torque of links and payload, in N m.
        applied: (hinges n,) MuJoCo's qfrc_applied in N m; changed.
        friction: (hinges n,) MuJoCo's dof_frictionloss in N m; changed.
        hinges: Hinges per joint; the first of a joint is the motor's side.
        step: Number of this step.

    Returns:
        False where a joint's speed is not a number or absurd: the simulation has diverged.
    """
    n = to_axis.shape[0]
    sane = True
    for i in range(n):
        q = 0.0
        dq = 0.0
        for k in range(n):
            q += to_axis[i, k] * position[hinges * k]
            dq += to_axis[i, k] * velocity[hinges * k]
        torque = 0.0
        if state[POWERED, i] != 0.0:
            error = POSITION_GAIN_1_S * (setpoint(state, i, step) - q) - dq
            limit = parameter[MAX_TORQUE, i]
            wanted = parameter[VELOCITY_GAIN, i] * error + state[INTEGRAL, i] + state[OFFSET, i]
            torque = min(max(wanted, -limit), limit)
            if torque == wanted or (wanted - torque) * error < 0.0:
                state[INTEGRAL, i] += parameter[INTEGRAL_GAIN, i] * error
        state[TORQUE, i] = torque
        gain = 1.0 + parameter[GAIN_ERROR, i] + parameter[GAIN_DRIFT, i] * step
        ripple = parameter[RIPPLE, i] * math.sin(parameter[RIPPLE_PER_RAD, i] * q)
        state[TRUE_TORQUE, i] = gain * torque + ripple
    for i in range(n):
        at_joint = 0.0
        for k in range(n):
            at_joint += to_axis[k, i] * state[TRUE_TORQUE, k]
        applied[hinges * i] = at_joint

        dq = velocity[hinges * i]
        if not abs(dq) < GREATEST_SPEED_RAD_S:
            sane = False
        load = link_torque[hinges * i]
        loss = parameter[LOSS_FORWARD, i] if load * dq >= 0.0 else parameter[LOSS_BACKWARD, i]
        slow = dq / parameter[STRIBECK_VELOCITY, i]
        friction[hinges * i] = (
            parameter[COULOMB, i]
            + parameter[STRIBECK, i] * math.exp(-slow * slow)
            + loss * abs(load)
            + state[BRAKED, i] * parameter[BRAKE, i]
        )
    return sane
