"""Types of the compiled kernels.

Functions that end in `_into` take C-contiguous arrays of float64 (links and indices: int64) and fill the one they are
given. States q, dq, ddq are (N, n) in rad, rad/s, rad/s2; n is 1 to MOST_JOINTS; `packed` is `Chain.packed`. They let
other threads run, and raise TypeError for another type of array and ValueError for another shape.
"""

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

MOST_JOINTS: int
"""Joints of the longest chain that the kernels take."""
MOST_JOINTS_OF_A_MESSAGE: int
"""Numbers in an array of a recorded message that the kernels take."""
BODY_PARAMETERS: int
"""Inertial parameters of a body."""
BOX_NUMBERS: int
"""A box in numbers: its axes as the columns of a rotation, by rows, 9; centre 3; half of its edges 3."""

def regressor_into(
    joints: int, packed: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /
) -> None:
    """Regressor of the flange (joints = 0) or of a link, into zeroed out (N, n, 10)."""

def body_regressor_into(packed: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /) -> None:
    """Regressors of all links side by side, into zeroed out (N, n, 10 n)."""

def payload_torque_into(model: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /) -> None:
    """Torque in N m of a payload into out (N, n); `model` is `packed` with the payload's ten parameters behind."""

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
    """Derivative of the torques' sum, weighted by (N, n), by q, dq and ddq into zeroed slope (3, N, n)."""

def information_into(
    packed: FloatArray, weight: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray, out: FloatArray, /
) -> None:
    """M = sum of Phi^T diag(weight) Phi of the flange's regressor, into out (10, 10); weight (n,)."""

def information_slope_into(
    packed: FloatArray,
    weight: FloatArray,
    gain: FloatArray,
    q: FloatArray,
    dq: FloatArray,
    ddq: FloatArray,
    slope: FloatArray,
    /,
) -> None:
    """Derivative of tr(gain M) by q, dq and ddq into slope (3, N, n); gain (10, 10) symmetric and constant."""

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
        links: (S,) what each sphere is fixed in: 0 the base, i the link that turns with joint i.
        spheres: (S, 4) centre in that link's turned frame, and radius.
        planes: (., 4) unit normal that points to where the arm may be, and distance from the origin along it.
        on_plane: (., 2) sphere and plane.
        boxes: (., BOX_NUMBERS).
        on_box: (., 2) sphere and box.
        pairs: (., 2) spheres.
        q: (N, n) configurations in rad.
        out: (N, K), K as many as on_plane, on_box and pairs have rows.
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
    """Rows of numbers from the messages of an own recording, until something follows that is left to the caller.

    That is a channel, a message that is not exactly what the recorder writes, one that is not whole, or a full table.
    Records of other kinds and channels are passed over.

    Args:
        records: MCAP records, one behind the other.
        at: Where in them to begin.
        channels: Numbers of the topic's channels, two bytes each, low byte first.
        arrays: Which arrays a row holds behind the position: 1 velocity_rad_s, 2 current_a, 4 torque_nm.
        joints: Numbers in an array.
        table: (N, 2 + joints (1 + arrays)) rows to fill: time_s, phase_s (NaN for null), position_rad, the arrays.

    Returns:
        Rows filled, messages passed over because their feedback is missing, and where the next record begins.
    """

def variants() -> list[str]:
    """Names of the instruction sets that the kernels are there for and this processor has; the first one is in use."""

def use_variant(name: str, /) -> None:
    """Choose kernels by instruction set, for the whole process: for tests and benchmarks."""

class PayloadTorque:
    """Torque of a payload for one state after the other, without any allocation.

    Args:
        model: (25 + 21 n,) `Chain.packed` with the payload's ten parameters behind; copied.
        torque: (n,) the array that every call fills and returns.
    """

    def __init__(self, model: FloatArray, torque: FloatArray, /) -> None: ...
    def torque_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray, /
    ) -> FloatArray:
        """Joint torques for one state.

        Args:
            position_rad: (n,) joint positions; arrays of float64 are the fast way, anything else is converted.
            velocity_rad_s: (n,) joint velocities.
            acceleration_rad_s2: (n,) joint accelerations.

        Returns:
            (n,) torques; the array is this object's own and changes with the next call.

        Raises:
            ValueError: a state that is not of n joints.
        """

    def change_parameters(self, theta: FloatArray, calls: int, /) -> None:
        """Go to other parameters over a number of calls, with rest at both ends; from any thread.

        Args:
            theta: (10,) parameters.
            calls: At least 1; the last of them has the new parameters.
        """

class PayloadEstimator:
    """What a calibrated arm carries, sample by sample, without any allocation.

    Args:
        packed: (15 + 21 n,) `Chain.packed`; this and the rest are copied.
        links: (n, 10) the arm's links in the turned joint frames.
        from_effort: (n, n) joint torque is effort @ from_effort.
        rotors: (n, n) joint torque per joint acceleration of the rotors.
        parameter: (ESTIMATOR_PARAMETERS, n) friction, speeds, noise and drift.
        scale: (10,) standard deviation of a payload's parameters beforehand.
        memory_s: Time after which what was seen counts 37 %.
        delay_s: By how much later than positions the drives report efforts.
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
        """Take a sample; one that is not finite, or not later than the last, is counted and left out.

        Args:
            time_s: Its stamp, of any clock.
            position_rad: (n,) joint positions.
            effort: (n,) motor currents in A or joint torques in N m, as the drives report them.

        Raises:
            ValueError: arrays that are not float64 of n numbers.
        """

    def update_all(self, time_s: FloatArray, position_rad: FloatArray, effort: FloatArray, /) -> None:
        """Take N samples, (N,) and (N, n) each."""

    def read_into(
        self,
        theta: FloatArray,
        covariance: FloatArray,
        friction: FloatArray,
        moving_s: FloatArray,
        status: FloatArray,
        /,
    ) -> None:
        """The estimate.

        Args:
            theta: (10,) parameters of the payload.
            covariance: (10, 10) of them, for a misfit of 1 and an arm that is known exactly.
            friction: (3, n) changes of Coulomb friction, viscous friction and offset.
            moving_s: (n,) time for which each joint moved fast enough, within the memory.
            status: (ESTIMATOR_STATUS,) what the estimator says of itself.
        """

    def rows_into(self, rows: FloatArray, /) -> int:
        """The rows of the last 20 s, since the payload changed last; how many there are.

        Args:
            rows: (REMEMBERED_ROWS, 1 + 4 n) time, q, dq, ddq, joint torque; the oldest first.
        """

class ServoLoops:
    """The servo loops of a simulated arm, over arrays that they share with it.

    Args:
        parameter: (SERVO_PARAMETERS, n) constants.
        state: (SERVO_STATES, n) setpoints and integrators; changed.
        to_axis: (n, n) C^-1, from joint to axis.
        position: (hinges n,) MuJoCo's qpos in rad; the first hinge of a joint is the motor's side.
        velocity: (hinges n,) MuJoCo's qvel in rad/s.
        link_torque: (hinges n,) torque of links and payload, in N m.
        applied: (hinges n,) MuJoCo's qfrc_applied in N m; changed.
        friction: (hinges n,) MuJoCo's dof_frictionloss in N m; changed.
        greatest_speed_rad_s: A joint that is faster shows that the simulation has diverged.
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
        """Close all loops once; False where the simulation has diverged.

        Args:
            number: Number of this step.
        """

    def setpoint(self, axis: int, number: float, /) -> float:
        """Setpoint of one axis in rad: interpolation between two setpoints, held afterwards.

        Linear, or with a speed that falls evenly from 2 (to - from) / duration to zero.

        Args:
            axis: Index of the axis.
            number: Number of the step asked for.
        """

    def ramp(self, axis: int, number: float, position: float, steps: float, slowing: bool, /) -> None:
        """Let the setpoint of one axis go from where it is to a position, then hold it.

        Args:
            axis: Index of the axis.
            number: Number of the step at which it begins.
            position: Where it goes, in rad.
            steps: Steps that it takes; 0 for at once.
            slowing: With a speed that falls evenly to zero, instead of linearly.
        """

    def measure(self, number: float, out: FloatArray, /) -> None:
        """What all axes and joints do at a step.

        Args:
            number: Number of the step, for the setpoints.
            out: (SERVO_MEASUREMENTS, n) filled, in rad, rad/s and N m.
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
SERVO_PARAMETERS: int

# Rows of `state`. Those down to BRAKED are set from outside, the others by the step.
SERVO_RAMP_FROM: int
SERVO_RAMP_TO: int
SERVO_RAMP_BEGIN: int  # step number
SERVO_RAMP_STEPS: int
SERVO_RAMP_SLOWING: int  # 0 or 1
SERVO_OFFSET: int
SERVO_POWERED: int  # 0 or 1
SERVO_BRAKED: int  # 0 or 1
SERVO_INTEGRAL: int
SERVO_TORQUE: int  # of the axis, as the drive believes
SERVO_TRUE_TORQUE: int  # of the axis
SERVO_STATES: int

# Rows of a measurement: what a drive can know of its axis, then the truth about the joint.
SERVO_AXIS_POSITION: int
SERVO_AXIS_VELOCITY: int
SERVO_AXIS_DEMAND: int
SERVO_AXIS_TORQUE: int  # as the drive believes, without noise
SERVO_JOINT_POSITION: int  # on the links' side of an elastic gear
SERVO_JOINT_VELOCITY: int
SERVO_JOINT_TORQUE: int  # of the motors
SERVO_LINK_TORQUE: int
SERVO_MEASUREMENTS: int

# Rows of the recursive estimator's parameters, each (n,).
ESTIMATOR_COULOMB: int
ESTIMATOR_VISCOUS: int
ESTIMATOR_ROOT: int
ESTIMATOR_LOAD: int
ESTIMATOR_REVERSAL: int  # speed about which the direction turns over
ESTIMATOR_GATE: int  # speed at which a row weighs 0.7
ESTIMATOR_NOISE: int  # of a row, as if rows were independent
ESTIMATOR_COLOUR: int  # for how many rows noise stays like itself
ESTIMATOR_COULOMB_SPREAD: int
ESTIMATOR_VISCOUS_SPREAD: int
ESTIMATOR_OFFSET_SPREAD: int
ESTIMATOR_PARAMETERS: int

# Rows of its status.
ESTIMATOR_TIME: int
ESTIMATOR_ROWS: int
ESTIMATOR_REFUSED: int
ESTIMATOR_MISFIT: int  # variance of the innovations in terms of what was expected, 1 or more
ESTIMATOR_CHANGE_TEST: int
ESTIMATOR_CHANGES: int
ESTIMATOR_CHANGED: int  # when
ESTIMATOR_CHANGE_MASS: int  # by about how much, from the last second
ESTIMATOR_CONTACT_RATIO: int  # torque at rest over what friction can hold
ESTIMATOR_CONTACT: int  # 0 or 1
ESTIMATOR_STATUS: int
REMEMBERED_ROWS: int
