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

int servo_step(const servo_loops *loops, double step, double greatest_speed_rad_s)
{
    const int n = loops->n, hinges = loops->hinges;
    int sane = 1;
    for (int i = 0; i < n; i++) {
        const double *parameter = loops->parameter + i;
        double *state = loops->state + i;
        double q = 0.0, dq = 0.0, torque = 0.0;
        for (int k = 0; k < n; k++) {
            q += loops->to_axis[n * i + k] * loops->position[hinges * k];
            dq += loops->to_axis[n * i + k] * loops->velocity[hinges * k];
        }
        if (state[SERVO_POWERED * n] != 0.0) {
            const double error = parameter[SERVO_POSITION_GAIN * n] * (servo_setpoint(loops, i, step) - q) - dq;
            const double limit = parameter[SERVO_MAX_TORQUE * n];
            const double wanted =
                parameter[SERVO_VELOCITY_GAIN * n] * error + state[SERVO_INTEGRAL * n] + state[SERVO_OFFSET * n];
            torque = wanted > limit ? limit : wanted < -limit ? -limit : wanted;
            /* the integral stands still while the limit is reached and would be exceeded further */
            if (torque == wanted || (wanted - torque) * error < 0.0) {
                state[SERVO_INTEGRAL * n] += parameter[SERVO_INTEGRAL_GAIN * n] * error;
            }
        }
        const double gain = 1.0 + parameter[SERVO_GAIN_ERROR * n] + parameter[SERVO_GAIN_DRIFT * n] * step;
        const double ripple = parameter[SERVO_RIPPLE * n] * sin(parameter[SERVO_RIPPLE_PER_RAD * n] * q);
        state[SERVO_TORQUE * n] = torque;
        state[SERVO_TRUE_TORQUE * n] = gain * torque + ripple;
    }
    for (int i = 0; i < n; i++) {
        const double *parameter = loops->parameter + i, *state = loops->state + i;
        const double dq = loops->velocity[hinges * i], load = loops->link_torque[hinges * i];
        const double loss = parameter[(load * dq >= 0.0 ? SERVO_LOSS_FORWARD : SERVO_LOSS_BACKWARD) * n];
        const double slow = dq / parameter[SERVO_STRIBECK_VELOCITY * n];
        double at_joint = 0.0;
        for (int k = 0; k < n; k++) {
            at_joint += loops->to_axis[n * k + i] * loops->state[SERVO_TRUE_TORQUE * n + k];
        }
        if (!(fabs(dq) < greatest_speed_rad_s)) {
            sane = 0;
        }
        loops->applied[hinges * i] = at_joint;
        loops->friction[hinges * i] = parameter[SERVO_COULOMB * n] + parameter[SERVO_STRIBECK * n] * exp(-slow * slow)
                                      + loss * fabs(load) + state[SERVO_BRAKED * n] * parameter[SERVO_BRAKE * n];
    }
    return sane;
}
