"""The servo loops and the joints' friction of a simulated arm: equations and constants.

The cascade of one axis, at 1 kHz:

    dq_ref = K_p (setpoint - q)                                    K_p = 25 1/s
    tau    = K_v (dq_ref - dq) + integral + torque offset          K_v = 2 pi 40 Hz * inertia
    integral' = K_v / T_i (dq_ref - dq)                            T_i = 20 ms

limited to the drive's greatest torque; the integral is held while the torque is at the limit and would exceed it
further. There is no velocity feed-forward: the arm follows with a lag of 1 / K_p. The motor produces (1 + e) times the
drive's nominal torque, plus ripple.

Friction of one joint opposes the motion with

    scale (coulomb + stribeck exp(-(dq / v_s)^2) + mu |tau_link|)

and MuJoCo holds the joint at rest while that suffices; viscous friction is the model's damping. With gear efficiencies
in place of mu, the loss is |tau_link| (1 / 0.85 - 1) if the motor drives the load and |tau_link| (1 - 0.75) if the load
drives the motor.

`armload_core.kernels.ServoLoops` implements one step, and names the rows of its arrays.
"""

POSITION_GAIN_1_S = 25.0
VELOCITY_BANDWIDTH_HZ = 40.0
INTEGRAL_TIME_S = 0.020
BRAKE_DELAY_S = 0.05
"""Usual time in which a servo motor's holding brake closes: data sheets give 10 ms for small and 100 ms for large
ones."""
EFFICIENCY_FORWARD = 0.85
EFFICIENCY_BACKWARD = 0.75
GREATEST_SPEED_RAD_S = 100.0
"""A simulation in which a joint turns faster has diverged."""
