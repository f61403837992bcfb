#include "servo_loops.h"

#include <math.h>

double servo_setpoint(const servo_loops *loops, int axis, double step)
{
    const int n = loops->n;
    const double *ramp = loops->state + axis;
    const double elapsed = step - ramp[SERVO_RAMP_BEGIN * n], steps = ramp[SERVO_RAMP_STEPS * n];
    if (elapsed >= steps) {
        return ramp[SERVO_RAMP_TO * n];
    }
    double share = elapsed / steps;
    share += ramp[SERVO_RAMP_SLOWING * n] * share * (1.0 - share);
    return ramp[SERVO_RAMP_FROM * n] + (ramp[SERVO_RAMP_TO * n] - ramp[SERVO_RAMP_FROM * n]) * share;
}

void servo_ramp(const servo_loops *loops, int axis, double step, double position, double steps, int slowing)
{
    const int n = loops->n;
    double *ramp = loops->state + axis;
    ramp[SERVO_RAMP_FROM * n] = servo_setpoint(loops, axis, step);
    ramp[SERVO_RAMP_TO * n] = position;
    ramp[SERVO_RAMP_BEGIN * n] = step;
    ramp[SERVO_RAMP_STEPS * n] = steps;
    ramp[SERVO_RAMP_SLOWING * n] = (double)slowing;
}

/* Position or velocity of one axis from those on the motor side of all joints. */
static double at_axis(const servo_loops *loops, int axis, const double *of_hinges)
{
    double sum = 0.0;
    for (int k = 0; k < loops->n; k++) {
        sum += loops->to_axis[loops->n * axis + k] * of_hinges[loops->hinges * k];
    }
    return sum;
}

double servo_position(const servo_loops *loops, int axis, double step)
{
    const int n = loops->n;
    const double *state = loops->state + axis;
    const double time_s = step * loops->parameter[SERVO_TIME_STEP * n + axis];
    return state[SERVO_ENCODER_SCALE * n] * at_axis(loops, axis, loops->position) + state[SERVO_ENCODER_OFFSET * n]
           + state[SERVO_ENCODER_DRIFT * n] * time_s;
}

/* Velocity of an axis, as its encoder has it. */
static double encoder_velocity(const servo_loops *loops, int axis)
{
    const double *state = loops->state + axis;
    return state[SERVO_ENCODER_SCALE * loops->n] * at_axis(loops, axis, loops->velocity)
           + state[SERVO_ENCODER_DRIFT * loops->n];
}

/* The motors' torque at one joint. */
static double at_joint(const servo_loops *loops, int joint)
{
    double sum = 0.0;
    for (int k = 0; k < loops->n; k++) {
        sum += loops->to_axis[loops->n * k + joint] * loops->state[SERVO_TRUE_TORQUE * loops->n + k];
    }
    return sum;
}

void servo_measure(const servo_loops *loops, double step, double *measured)
{
    const int n = loops->n, hinges = loops->hinges;
    for (int i = 0; i < n; i++) {
        double *row = measured + i;
        double position = 0.0, velocity = 0.0;
        for (int side = 0; side < hinges; side++) {
            position += loops->position[hinges * i + side];
            velocity += loops->velocity[hinges * i + side];
        }
        row[SERVO_AXIS_POSITION * n] = servo_position(loops, i, step);
        row[SERVO_AXIS_VELOCITY * n] = encoder_velocity(loops, i);
        row[SERVO_AXIS_DEMAND * n] = servo_setpoint(loops, i, step);
        row[SERVO_AXIS_TORQUE * n] = loops->state[SERVO_TORQUE * n + i];
        row[SERVO_JOINT_POSITION * n] = position;
        row[SERVO_JOINT_VELOCITY * n] = velocity;
        row[SERVO_JOINT_TORQUE * n] = at_joint(loops, i);
        row[SERVO_LINK_TORQUE * n] = loops->link_torque[hinges * i];
    }
}

int servo_step(const servo_loops *loops, double step, double greatest_speed_rad_s)
{
    const int n = loops->n, hinges = loops->hinges;
    int sane = 1;
    for (int i = 0; i < n; i++) {
        const double *parameter = loops->parameter + i;
        double *state = loops->state + i;
        double torque = 0.0;
        if (step < state[SERVO_POWER_ENDS * n]) {
            const double lag = servo_setpoint(loops, i, step) - servo_position(loops, i, step);
            const double error = parameter[SERVO_POSITION_GAIN * n] * lag - encoder_velocity(loops, i);
            const double limit = parameter[SERVO_MAX_TORQUE * n];
            const double wanted =
                parameter[SERVO_VELOCITY_GAIN * n] * error + state[SERVO_INTEGRAL * n] + state[SERVO_OFFSET * n];
            torque = wanted > limit ? limit : wanted < -limit ? -limit : wanted;
            /* anti-windup: no integration further into the torque limit */
            if (torque == wanted || (wanted - torque) * error < 0.0) {
                state[SERVO_INTEGRAL * n] += parameter[SERVO_INTEGRAL_GAIN * n] * error;
            }
        }
        const double gain = 1.0 + parameter[SERVO_GAIN_ERROR * n] + parameter[SERVO_GAIN_DRIFT * n] * step;
        const double turned = parameter[SERVO_RIPPLE_PER_RAD * n] * at_axis(loops, i, loops->position);
        const double ripple = parameter[SERVO_RIPPLE * n] * sin(turned);
        state[SERVO_TORQUE * n] = torque;
        state[SERVO_TRUE_TORQUE * n] = gain * torque + ripple;
    }
    for (int i = 0; i < n; i++) {
        const double *parameter = loops->parameter + i, *state = loops->state + i;
        const double dq = loops->velocity[hinges * i], load = loops->link_torque[hinges * i];
        const double loss = parameter[(load * dq >= 0.0 ? SERVO_LOSS_FORWARD : SERVO_LOSS_BACKWARD) * n];
        const double slow = dq / parameter[SERVO_STRIBECK_VELOCITY * n];
        const double brake = step < state[SERVO_BRAKE_BEGINS * n] ? 0.0 : parameter[SERVO_BRAKE * n];
        if (!(fabs(dq) < greatest_speed_rad_s)) {
            sane = 0;
        }
        loops->applied[hinges * i] = at_joint(loops, i);
        loops->friction[hinges * i] = parameter[SERVO_COULOMB * n] + parameter[SERVO_STRIBECK * n] * exp(-slow * slow)
                                      + loss * fabs(load) + brake;
    }
    return sane;
}
