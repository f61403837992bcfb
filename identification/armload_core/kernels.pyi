"""Types of the compiled kernels.

Functions that end in `_into` take C-contiguous arrays of float64 (links and indices: int64) and write their result to
the array `out` or as named. States q, dq, ddq are (N, n) in rad, rad/s, rad/s2; n is 1 to MOST_JOINTS; `packed` is
`Chain.packed`. They release the interpreter's lock, and raise TypeError for an array of another type and ValueError for
one of another shape.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]

MOST_JOINTS: int
"""Greatest number of joints of a chain."""
MOST_JOINTS_OF_A_MESSAGE: int
"""Greatest number of joints in a recorded message."""
BODY_PARAMETERS: int
"""Number of inertial parameters of a body."""
BOX_NUMBERS: int
"""Numbers of a box: rotation with its axes as columns, stored row by row (9), centre (3), half edge lengths (3)."""

def payload_regressor_into(
    packed: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /
) -> None:
    """Regressor of a body on the flange, into out (N, n, 10)."""

def body_regressor_into(packed: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /) -> None:
    """Regressors of all links side by side, into zeroed out (N, n, 10 n)."""

def payload_torque_into(model: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /) -> None:
    """Torque in N m of a payload into out (N, n); `model` is `packed` followed by the payload's ten parameters."""

def arm_torque_into(
    packed: FloatArray, links: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /
) -> None:
    """Torque in N m of all links into out (N, n); links (n, 10) in the turned joint frames."""

def arm_torque_slope_into(
    packed: FloatArray,
    links: FloatArray,
    weight: FloatArray,
    q: FloatArray,
    dq: FloatArray,
    ddq: FloatArray,
    slope: FloatArray,
    /,
) -> None:
    """Derivative of the sum of weight (N, n) times torque by q, dq and ddq, into zeroed slope (3, N, n)."""

def regressor_slope_into(
    packed: FloatArray, bodies: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, slope: FloatArray, /
) -> None:
    """Derivative of the sum of regressor times bodies (N, n, 10) by q, dq and ddq, into slope (3, N, n)."""

def clearances_into(
    packed: FloatArray,
    links: NDArray[np.int64],
    spheres: FloatArray,
    planes: FloatArray,
    on_plane: NDArray[np.int64],
    boxes: FloatArray,
    on_box: NDArray[np.int64],
    pairs: NDArray[np.int64],
    q: FloatArray,
    out: FloatArray,
    /,
) -> None:
    """Distances in m of spheres from half-spaces, boxes and each other, in this order, into out (N, K).

    Args:
        packed: The arm.
        links: (S,) link to which each sphere is fixed: 0 the base, i the link that moves with joint i.
        spheres: (S, 4) centre in that link's turned frame and radius, in m.
        planes: (., 4) unit normal towards the free side, and distance of the plane from the origin along it in m.
        on_plane: (., 2) indices of sphere and plane.
        boxes: (., BOX_NUMBERS) boxes, in m.
        on_box: (., 2) indices of sphere and box.
        pairs: (., 2) indices of two spheres.
        q: (N, n) configurations in rad.
        out: (N, K), K the total number of rows of on_plane, on_box and pairs.
    """

def clearance_slope_into(
    packed: FloatArray,
    links: NDArray[np.int64],
    spheres: FloatArray,
    planes: FloatArray,
    on_plane: NDArray[np.int64],
    boxes: FloatArray,
    on_box: NDArray[np.int64],
    pairs: NDArray[np.int64],
    q: FloatArray,
    slope: FloatArray,
    weight: FloatArray,
    /,
) -> None:
    """Derivative of the sum of weight (N, K) times clearance by q, into zeroed slope (N, n)."""

def sine_cosine_into(angle: FloatArray, sine: FloatArray, cosine: FloatArray, /) -> None:
    """Sine and cosine of (N, n) angles as the kernels compute them."""

def joint_rows_into(
    records: bytes, at: int, channels: bytes, arrays: int, joints: int, table: FloatArray, /
) -> tuple[int, int, int]:
    """Rows of numbers from the messages of a recording, up to the first record that is left to the caller.

    That is a channel, a truncated message, or one that is not exactly as the recorder writes it. The scan also stops
    when the table is full. Records of other kinds and channels are skipped.

    Args:
        records: Consecutive MCAP records.
        at: Offset at which to begin.
        channels: Numbers of the topic's channels, two bytes each, low byte first.
        arrays: Sum of the arrays that a row holds after the position: 1 velocity_rad_s, 2 current_a, 4 torque_nm.
        joints: Length of each array.
        table: (N, 2 + joints (1 + number of arrays)) rows to fill: time_s, phase_s (NaN for null), position_rad,
            arrays.

    Returns:
        Number of rows filled, number of messages skipped because their feedback is missing, and the offset of the next
        record.
    """

def variants() -> list[str]:
    """Instruction sets that have kernels and that this processor supports; the first is the default."""

def use_variant(name: str, /) -> None:
    """Select the kernels' instruction set for the process, in tests and benchmarks."""

class PayloadTorque:
    """Torque of a payload, state by state, without allocation.

    Args:
        model: (25 + 21 n,) `Chain.packed` followed by the payload's ten parameters; copied.
        torque: (n,) array that every call fills and returns, in N m.
    """

    def __init__(self, model: FloatArray, torque: FloatArray, /) -> None: ...
    def torque_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray, /
    ) -> FloatArray:
        """Joint torques for one state.

        Args:
            position_rad: (n,) joint positions; arrays of float64 are fastest, anything else is converted.
            velocity_rad_s: (n,) joint velocities.
            acceleration_rad_s2: (n,) joint accelerations.

        Returns:
            (n,) torques; the array belongs to this object and changes with the next call.

        Raises:
            ValueError: a state does not have n joints.
        """

    def change_parameters(self, theta: FloatArray, calls: int, /) -> None:
        """Blend to other parameters over a number of calls, with zero slope at both ends; from any thread.

        Args:
            theta: (10,) new parameters.
            calls: Number of calls, at least 1; the last one uses the new parameters.
        """

class PayloadEstimator:
    """Recursive estimate of a calibrated arm's payload, sample by sample, without allocation.

    Args:
        packed: (15 + 21 n,) `Chain.packed`; this and the other arrays are copied.
        links: (n, 10) parameters of the arm's links in the turned joint frames.
        from_effort: (n, n) joint torque is effort @ from_effort.
        rotors: (n, n) rotor inertia: joint torque per joint acceleration, in kg m2.
        parameter: (ESTIMATOR_PARAMETERS, n) friction, speeds, noise and drift.
        scale: (10,) prior standard deviations of the payload's parameters.
        memory_s: Time constant of the exponential forgetting.
        delay_s: Delay of the reported efforts relative to the positions.
    """

    def __init__(
        self,
        packed: FloatArray,
        links: FloatArray,
        from_effort: FloatArray,
        rotors: FloatArray,
        parameter: FloatArray,
        scale: FloatArray,
        memory_s: float,
        delay_s: float,
        /,
    ) -> None: ...
    def update(self, time_s: float, position_rad: FloatArray, effort: FloatArray, /) -> None:
        """Process a sample; one that is not finite, or not later than the last, is rejected and counted.

        Args:
            time_s: Time stamp, of any clock.
            position_rad: (n,) joint positions.
            effort: (n,) motor currents in A or joint torques in N m, as the drives report them.

        Raises:
            ValueError: an array is not n numbers of float64.
        """

    def update_all(self, time_s: FloatArray, position_rad: FloatArray, effort: FloatArray, /) -> None:
        """Process N samples: (N,) times, (N, n) positions and efforts."""

    def exchange(self, time_s: float, /) -> None:
        """Another payload since a time, as known from elsewhere: the next sample forgets the old one."""

    def become(self, other: PayloadEstimator, /) -> None:
        """Take over the state of another estimator, of the same arm: 0.3 MB are copied."""

    def read_into(
        self,
        theta: FloatArray,
        covariance: FloatArray,
        friction: FloatArray,
        moving_s: FloatArray,
        status: FloatArray,
        /,
    ) -> None:
        """Write the estimate to the arrays.

        Args:
            theta: (10,) parameters of the payload.
            covariance: (10, 10) their covariance for an exactly known arm.
            friction: (3, n) changes of Coulomb friction, viscous friction and offset.
            moving_s: (n,) time within the memory in which each joint moved fast enough.
            status: (ESTIMATOR_STATUS,) the estimator's status.
        """

    def friction_into(self, covariance: FloatArray, /) -> None:
        """Write the (n, 3, 3) covariance of each joint's changes of Coulomb friction, viscous friction and offset."""

    def rows_into(self, rows: FloatArray, /) -> int:
        """Write the rows of the last 20 s, or since the last change of payload, and return their number.

        Args:
            rows: (REMEMBERED_ROWS, 1 + 4 n) time, q, dq, ddq, joint torque; oldest first.
        """

class ServoLoops:
    """The servo loops of a simulated arm, on arrays shared with the simulation.

    Args:
        parameter: (SERVO_PARAMETERS, n) constants.
        state: (SERVO_STATES, n) setpoints and integrators; modified.
        to_axis: (n, n) C^-1, from joint to axis.
        position: (hinges n,) MuJoCo's qpos in rad; the first hinge of a joint is the motor side.
        velocity: (hinges n,) MuJoCo's qvel in rad/s.
        link_torque: (hinges n,) torque of links and payload, in N m.
        applied: (hinges n,) MuJoCo's qfrc_applied in N m; modified.
        friction: (hinges n,) MuJoCo's dof_frictionloss in N m; modified.
        greatest_speed_rad_s: Above this joint speed the simulation counts as diverged.
    """

    def __init__(
        self,
        parameter: FloatArray,
        state: FloatArray,
        to_axis: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        link_torque: FloatArray,
        applied: FloatArray,
        friction: FloatArray,
        greatest_speed_rad_s: float,
        /,
    ) -> None: ...
    def step(self, number: float, /) -> bool:
        """Compute one step of all loops; False if the simulation has diverged.

        Args:
            number: Number of this step.
        """

    def setpoint(self, axis: int, number: float, /) -> float:
        """Setpoint of one axis in rad: a ramp between two setpoints, held afterwards.

        The ramp is linear, or its speed falls linearly from 2 (to - from) / duration to zero.

        Args:
            axis: Index of the axis.
            number: Number of the step.
        """

    def position(self, axis: int, number: float, /) -> float:
        """Position of one axis at a step as its encoder has it, in rad."""

    def ramp(self, axis: int, number: float, position: float, steps: float, slowing: bool, /) -> None:
        """Ramp the setpoint of one axis from its present value to a position, then hold it.

        Args:
            axis: Index of the axis.
            number: Number of the step at which the ramp begins.
            position: Final setpoint, in rad.
            steps: Duration in steps; 0 for a step change.
            slowing: Whether the speed falls linearly to zero instead of being constant.
        """

    def measure(self, number: float, out: FloatArray, /) -> None:
        """Measurements of all axes and joints at a step.

        Args:
            number: Number of the step, for the setpoints.
            out: (SERVO_MEASUREMENTS, n) array to fill, in rad, rad/s and N m.
        """

# Rows of `parameter`, constant.
SERVO_POSITION_GAIN: int
SERVO_VELOCITY_GAIN: int
SERVO_INTEGRAL_GAIN: int  # per time step
SERVO_MAX_TORQUE: int
SERVO_RIPPLE: int
SERVO_RIPPLE_PER_RAD: int  # of the axis
SERVO_GAIN_ERROR: int
SERVO_GAIN_DRIFT: int  # per time step
SERVO_COULOMB: int
SERVO_STRIBECK: int
SERVO_STRIBECK_VELOCITY: int
SERVO_LOSS_FORWARD: int  # per |link torque|
SERVO_LOSS_BACKWARD: int
SERVO_BRAKE: int
SERVO_TIME_STEP: int  # s
SERVO_PARAMETERS: int

# Rows of `state`. Those up to ENCODER_DRIFT are inputs, the others are set by the step.
SERVO_RAMP_FROM: int
SERVO_RAMP_TO: int
SERVO_RAMP_BEGIN: int  # step number
SERVO_RAMP_STEPS: int
SERVO_RAMP_SLOWING: int  # 0 or 1
SERVO_OFFSET: int
SERVO_POWER_ENDS: int  # step number from which the motor has no torque
SERVO_BRAKE_BEGINS: int  # step number from which the brake is engaged
SERVO_ENCODER_SCALE: int  # the loops see scale * position + offset + drift * time; 1, 0, 0 is a sound encoder
SERVO_ENCODER_OFFSET: int
SERVO_ENCODER_DRIFT: int  # rad/s
SERVO_INTEGRAL: int
SERVO_TORQUE: int  # of the axis, nominal: the drive's own value
SERVO_TRUE_TORQUE: int  # of the axis, with gain error and ripple
SERVO_STATES: int

# Rows of a measurement: what the drive of an axis measures, then the true values of the joint.
SERVO_AXIS_POSITION: int
SERVO_AXIS_VELOCITY: int
SERVO_AXIS_DEMAND: int
SERVO_AXIS_TORQUE: int  # nominal, without noise
SERVO_JOINT_POSITION: int  # on the link side of an elastic gear
SERVO_JOINT_VELOCITY: int
SERVO_JOINT_TORQUE: int  # of the motors
SERVO_LINK_TORQUE: int
SERVO_MEASUREMENTS: int

# Rows of the recursive estimator's parameters, each (n,).
ESTIMATOR_COULOMB: int
ESTIMATOR_VISCOUS: int
ESTIMATOR_ROOT: int
ESTIMATOR_LOAD: int
ESTIMATOR_REVERSAL: int  # speed in rad/s below which the friction direction is smoothed
ESTIMATOR_GATE: int  # speed in rad/s at which a row has weight 0.7
ESTIMATOR_NOISE: int  # of a row in N m, times sqrt(COLOUR): correlated rows are then counted as independent
ESTIMATOR_COLOUR: int  # correlation length of the noise in rows
ESTIMATOR_COULOMB_SPREAD: int
ESTIMATOR_VISCOUS_SPREAD: int
ESTIMATOR_OFFSET_SPREAD: int
ESTIMATOR_PARAMETERS: int

# Rows of its status.
ESTIMATOR_TIME: int
ESTIMATOR_ROWS: int
ESTIMATOR_REFUSED: int
ESTIMATOR_MISFIT: int  # variance of the innovations over the expected one, at least 1; the largest of all joints
ESTIMATOR_CHANGE_TEST: int
ESTIMATOR_CHANGES: int
ESTIMATOR_CHANGED: int  # time of the last change
ESTIMATOR_CHANGE_MASS: int  # its approximate change of mass in kg, from the last second
ESTIMATOR_CONTACT_RATIO: int  # unexplained torque at rest over the friction torque
ESTIMATOR_CONTACT: int  # 0 or 1
ESTIMATOR_STATUS: int
REMEMBERED_ROWS: int
