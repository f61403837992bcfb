#include "sample_window.h"

#include <math.h>
#include <string.h>

#include "estimator_numbers.h"

enum { POWERS = 4 }; /* coefficients of the cubic */

void window_clear(payload_estimator *e)
{
    e->held = e->next = e->gathered = 0;
}

void window_close_mean(payload_estimator *e)
{
    joint_sample *mean = e->smoothed + e->next;
    const double share = 1.0 / e->gathered;
    mean->time = e->gathering_since + share * e->gathering.time;
    for (int j = 0; j < e->n; j++) {
        mean->position[j] = share * e->gathering.position[j];
        mean->torque[j] = share * e->gathering.torque[j];
    }
    e->next = (e->next + 1) % SMOOTHED;
    e->held += e->held < SMOOTHED;
    e->gathered = 0;
}

int window_row(const payload_estimator *e, estimator_row *row)
{
    const joint_sample *newest = e->smoothed + (e->next + SMOOTHED - 1) % SMOOTHED;
    double moment[2 * POWERS - 1] = {0.0}, factor[POWERS][POWERS], weight[POWERS];
    double power[SMOOTHED][POWERS], second[SMOOTHED], third[SMOOTHED];
    const joint_sample *at[SMOOTHED];
    int used = 0;
    while (used < e->held
           && newest->time - e->smoothed[(e->next + 2 * SMOOTHED - 1 - used) % SMOOTHED].time <= WINDOW_S) {
        used++;
    }
    if (used < LEAST_MEANS) {
        return 0;
    }
    const joint_sample *oldest = e->smoothed + (e->next + SMOOTHED - used) % SMOOTHED;
    const double half = 0.5 * (newest->time - oldest->time);
    if (!(half > LEAST_HALF_SPAN * WINDOW_S)) {
        return 0;
    }
    for (int k = 0; k < used; k++) {
        at[k] = e->smoothed + (e->next + SMOOTHED - used + k) % SMOOTHED;
        const double u = (at[k]->time - oldest->time) / half - 1.0;
        double p = 1.0;
        for (int m = 0; m < 2 * POWERS - 1; m++, p *= u) {
            moment[m] += p;
            if (m < POWERS) {
                power[k][m] = p;
            }
        }
    }
    for (int i = 0; i < POWERS; i++) {
        for (int j = 0; j <= i; j++) {
            double s = moment[i + j];
            for (int k = 0; k < j; k++) {
                s -= factor[i][k] * factor[j][k];
            }
            if (i == j && !(s > LEAST_PIVOT)) {
                return 0;
            }
            factor[i][j] = i == j ? sqrt(s) : s / factor[j][j];
        }
    }
    /* The second derivative from the cubic is the true one filtered by a kernel, whose second derivative are the fit's
       weights. All signals are filtered by it, so that torque and motion correspond even with high jerk. */
    double kernel[SMOOTHED], whole = 0.0, slope = 0.0;
    for (int k = 0; k < used; k++) {
        const double h = k == 0 ? 0.0 : at[k]->time - at[k - 1]->time;
        for (int i = 0; i < POWERS; i++) {
            weight[i] = power[k][i];
            for (int m = 0; m < i; m++) {
                weight[i] -= factor[i][m] * weight[m];
            }
            weight[i] /= factor[i][i];
        }
        for (int i = POWERS - 1; i >= 2; i--) {
            for (int m = i + 1; m < POWERS; m++) {
                weight[i] -= factor[m][i] * weight[m];
            }
            weight[i] /= factor[i][i];
        }
        second[k] = 2.0 * weight[2] / (half * half);
        third[k] = 6.0 * weight[3] / (half * half * half);
        kernel[k] = k == 0 ? 0.0 : kernel[k - 1] + slope * h;
        whole += k == 0 ? 0.0 : 0.5 * h * (kernel[k - 1] + kernel[k]);
        slope += second[k];
    }
    if (!(whole > LEAST_AREA)) {
        return 0;
    }
    memset(row->position, 0, sizeof row->position);
    memset(row->velocity, 0, sizeof row->velocity);
    memset(row->acceleration, 0, sizeof row->acceleration);
    memset(row->jerk, 0, sizeof row->jerk);
    memset(row->torque, 0, sizeof row->torque);
    memset(row->direction, 0, sizeof row->direction);
    row->time = oldest->time;
    for (int k = 0; k < used; k++) {
        const double before = k == 0 ? 0.0 : at[k]->time - at[k - 1]->time;
        const double behind = k + 1 == used ? 0.0 : at[k + 1]->time - at[k]->time;
        const double share = 0.5 * (before + behind) * kernel[k] / whole;
        const double between = k == 0 ? 0.0 : 0.5 * (kernel[k - 1] + kernel[k]) / whole;
        row->time += share * (at[k]->time - oldest->time);
        for (int j = 0; j < e->n; j++) {
            const double from_newest = at[k]->position[j] - newest->position[j];
            const double step = k == 0 ? 0.0 : at[k]->position[j] - at[k - 1]->position[j];
            const double turn = e->parameter[ESTIMATOR_REVERSAL][j] * before;
            row->position[j] += share * from_newest;
            row->velocity[j] += between * step;
            row->acceleration[j] += second[k] * from_newest;
            row->jerk[j] += third[k] * from_newest;
            row->torque[j] += share * at[k]->torque[j];
            row->direction[j] += between * before * (fabs(step) < turn ? step / turn : copysign(before > 0.0, step));
        }
    }
    for (int j = 0; j < e->n; j++) {
        row->position[j] += newest->position[j] - e->delay_s * row->velocity[j];
        row->velocity[j] -= e->delay_s * row->acceleration[j];
        row->acceleration[j] -= e->delay_s * row->jerk[j];
    }
    return 1;
}
