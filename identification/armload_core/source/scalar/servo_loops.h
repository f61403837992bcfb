/* One step of all servo loops and of the joint friction of a simulated arm; the equations are in Python's
   `servo_loops`. Arrays have one column per axis or joint; MuJoCo's have `hinges` numbers per joint, the first for the
   motor side. */

#ifndef ARMLOAD_SERVO_LOOPS_H
#define ARMLOAD_SERVO_LOOPS_H

/* clang-format off */
/* Rows of `parameter`, constant. */
#define SERVO_PARAMETER_ROWS(ROW) \
    ROW(POSITION_GAIN)            \
    ROW(VELOCITY_GAIN)            \
    ROW(INTEGRAL_GAIN) /* per time step */ \
    ROW(MAX_TORQUE)               \
    ROW(RIPPLE)                   \
    ROW(RIPPLE_PER_RAD) /* of the axis */ \
    ROW(GAIN_ERROR)               \
    ROW(GAIN_DRIFT) /* per time step */ \
    ROW(COULOMB)                  \
    ROW(STRIBECK)                 \
    ROW(STRIBECK_VELOCITY)        \
    ROW(LOSS_FORWARD) /* per |link torque| */ \
    ROW(LOSS_BACKWARD)            \
    ROW(BRAKE)                    \
    ROW(TIME_STEP) /* s */

/* Rows of `state`. Those up to ENCODER_DRIFT are inputs, the others are set by the step. The loops of an axis see
   ENCODER_SCALE q + ENCODER_OFFSET + ENCODER_DRIFT t in place of its position q; 1, 0, 0 is a sound encoder. */
#define SERVO_STATE_ROWS(ROW) \
    ROW(RAMP_FROM)            \
    ROW(RAMP_TO)              \
    ROW(RAMP_BEGIN) /* step number */ \
    ROW(RAMP_STEPS)           \
    ROW(RAMP_SLOWING) /* 0 or 1 */ \
    ROW(OFFSET)               \
    ROW(POWER_ENDS) /* step number from which the motor has no torque */ \
    ROW(BRAKE_BEGINS) /* step number from which the brake is engaged */ \
    ROW(ENCODER_SCALE) \
    ROW(ENCODER_OFFSET) \
    ROW(ENCODER_DRIFT) /* rad/s */ \
    ROW(INTEGRAL)             \
    ROW(TORQUE) /* of the axis, nominal: the drive's own value */ \
    ROW(TRUE_TORQUE) /* of the axis, with gain error and ripple */

/* Rows of a measurement: what the drive of an axis measures, then the true values of the joint. */
#define SERVO_MEASURED_ROWS(ROW) \
    ROW(AXIS_POSITION) /* as its encoder has it */ \
    ROW(AXIS_VELOCITY) /* likewise */ \
    ROW(AXIS_DEMAND)             \
    ROW(AXIS_TORQUE) /* nominal, without noise */ \
    ROW(JOINT_POSITION) /* on the link side of an elastic gear */ \
    ROW(JOINT_VELOCITY)          \
    ROW(JOINT_TORQUE) /* of the motors */ \
    ROW(LINK_TORQUE)
/* clang-format on */

#define AS_ENUM(name) SERVO_##name,
enum { SERVO_PARAMETER_ROWS(AS_ENUM) SERVO_PARAMETERS };
enum { SERVO_STATE_ROWS(AS_ENUM) SERVO_STATES };
enum { SERVO_MEASURED_ROWS(AS_ENUM) SERVO_MEASUREMENTS };
#undef AS_ENUM

typedef struct {
    int n, hinges;
    const double *parameter;   /* (SERVO_PARAMETERS, n) */
    double *state;             /* (SERVO_STATES, n) */
    const double *to_axis;     /* (n, n) C^-1, from joint to axis */
    const double *position;    /* (hinges n) rad */
    const double *velocity;    /* (hinges n) rad/s */
    const double *link_torque; /* (hinges n) N m, of links and payload */
    double *applied;           /* (hinges n) N m, set */
    double *friction;          /* (hinges n) N m, set */
} servo_loops;

/* Setpoint of an axis in rad: a ramp, linear or with a speed that falls linearly to zero, then held. */
double servo_setpoint(const servo_loops *loops, int axis, double step);

/* Position of an axis in rad at a step, as its encoder has it. */
double servo_position(const servo_loops *loops, int axis, double step);

/* Start a ramp of an axis's setpoint from its present value to a position within `steps`; `slowing` is 0 or 1. */
void servo_ramp(const servo_loops *loops, int axis, double step, double position, double steps, int slowing);

/* Fill (SERVO_MEASUREMENTS, n) with the measurements of all axes and joints at a step. */
void servo_measure(const servo_loops *loops, double step, double *measured);

/* Compute one step of all loops. Returns 0 if a joint's speed is NaN or not below `greatest_speed_rad_s`. */
int servo_step(const servo_loops *loops, double step, double greatest_speed_rad_s);

#endif
