/* `armload export --format c` writes this file and all that it includes of this folder for one arm: its header, and one
   file of the others, with straight-line code as `estimator_arm` and static functions in place of those that only this
   folder shares. From the rest of the core they use only MOST_JOINTS and BODY_PARAMETERS of `chain.h`. */
#include "payload_estimator.h"

#include <math.h>
#include <string.h>

#include "estimator_numbers.h"
#include "small_matrices.h"
#include "sample_window.h"
#include "information_filter.h"
#include "change_detection.h"

void estimator_begin(payload_estimator *e)
{
    e->started = 0;
    e->row_time = -HUGE_VAL;
    e->remembered = e->next_row = 0;
    e->noticing = 0;
    e->changed = e->change_mass = e->changes = e->contact_ratio = e->rows = e->refused = e->last_time = 0.0;
    e->touched_since = -HUGE_VAL;
    memset(e->moving_s, 0, sizeof e->moving_s);
    memset(e->joint, 0, sizeof e->joint);
    window_clear(e);
    change_clear(e);
    e->watched_s = e->waited_s = e->level = 0.0;
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        f->misfit = f->scatter = f->learnt = 1.0;
        for (int i = 0; i < WAITING; i++) {
            f->waiting[i] = 1.0;
        }
    }
    filter_solve(e); /* cannot fail: only the prior is left */
}

/* Compute the estimates. Information that is not finite must not persist. */
static void solve(payload_estimator *e)
{
    if (!filter_solve(e)) {
        estimator_begin(e);
    }
}

/* Another payload: nothing is known of it, and of each joint's friction what was known beside the old one. */
static void forget_payload(payload_estimator *e)
{
    filter_forget_payload(e);
    change_clear(e);
    e->watched_s = fmin(e->watched_s, KNOWN_S - ANEW_S);
    e->remembered = e->next_row = 0;
    memset(e->moving_s, 0, sizeof e->moving_s);
    solve(e);
}

/* The model's row: the mean of two points of the window, one standard deviation of its kernel before and after the
   middle, because the torque is a mean over the window. The torque at the mean position differs from that: by 4 N m for
   er50's own weight at joint speeds of 1.5 rad/s. Without the jerk between the points, 10 kg are found as 9.8. `rate` is
   the torque's change with time. */
static void modelled(const payload_estimator *e, const estimator_row *row, double *regressor, double *links, double *rate)
{
    double position[MOST_JOINTS], velocity[MOST_JOINTS], acceleration[MOST_JOINTS], links_later[MOST_JOINTS];
    double later[MOST_JOINTS * BODY_PARAMETERS] = {0.0};
    const double away = DEVIATION * WINDOW_S;
    for (int side = -1; side <= 1; side += 2) {
        for (int j = 0; j < e->n; j++) {
            position[j] = row->position[j] + side * away * row->velocity[j];
            velocity[j] = row->velocity[j] + side * away * row->acceleration[j];
            acceleration[j] = row->acceleration[j] + side * away * row->jerk[j];
        }
        estimator_arm(e, position, velocity, acceleration, side < 0 ? regressor : later, side < 0 ? links : links_later);
    }
    for (int j = 0; j < e->n; j++) {
        double change = links_later[j] - links[j];
        links[j] = 0.5 * (links[j] + links_later[j]);
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            double *const column = regressor + j * BODY_PARAMETERS + k;
            const double other = later[j * BODY_PARAMETERS + k];
            change += (other - *column) * e->scale[k] * e->theta[k];
            *column = 0.5 * (*column + other);
        }
        rate[j] = 0.5 * change / away;
    }
}

static void take_row(payload_estimator *e)
{
    estimator_row *row = e->row + e->next_row;
    double regressor[MOST_JOINTS * BODY_PARAMETERS] = {0.0}, links[MOST_JOINTS], payload[MOST_JOINTS], rate[MOST_JOINTS];
    const int n = e->n;
    if (!window_row(e, row)) {
        return;
    }
    const double elapsed = fmin(row->time - e->row_time, e->memory_s);
    e->row_time = row->time;
    e->rows += 1.0;
    e->next_row = (e->next_row + 1) % REMEMBERED_ROWS;
    e->remembered += e->remembered < REMEMBERED_ROWS;
    modelled(e, row, regressor, links, rate);
    for (int j = 0; j < n; j++) {
        payload[j] = 0.0;
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            regressor[j * BODY_PARAMETERS + k] *= e->scale[k];
            payload[j] += regressor[j * BODY_PARAMETERS + k] * e->theta[k];
        }
    }
    contact_watch(e, row, links, payload);
    filter_fade(e, elapsed);
    const double counted = fmin(elapsed, MOST_ROWS * ROW_S);
    surprise seen[MOST_JOINTS];
    int count = 0;
    for (int j = 0; j < n; j++) {
        const double dq = row->velocity[j], gate = e->parameter[ESTIMATOR_GATE][j];
        /* The friction model does not hold if the joint stands or reverses within the window. */
        const double onward = fmax((fabs(row->direction[j]) - ONWARD) / (1.0 - ONWARD), 0.0);
        const double ratio = (dq / gate) * (dq / gate), gated = onward * ratio / sqrt(1.0 + ratio * ratio);
        if (gated < LEAST_WEIGHT) {
            continue;
        }
        e->moving_s[j] += fabs(dq) > gate ? counted : 0.0;
        const double s = row->direction[j];
        const double turned = links[j] + payload[j] < 0.0 ? -1.0 : 1.0;
        const double through = 1.0 + e->parameter[ESTIMATOR_LOAD][j] * s * turned;
        const double steady = e->parameter[ESTIMATOR_COULOMB][j] + e->parameter[ESTIMATOR_ROOT][j] * sqrt(fabs(dq));
        const double friction = e->parameter[ESTIMATOR_VISCOUS][j] * dq + s * steady;
        double arm = through * links[j] + friction;
        for (int k = 0; k < n; k++) {
            arm += e->rotors[j * n + k] * row->acceleration[k];
        }
        const double f[FRICTION_STATES] = {s * e->parameter[ESTIMATOR_COULOMB_SPREAD][j],
                                           dq * e->parameter[ESTIMATOR_VISCOUS_SPREAD][j],
                                           e->parameter[ESTIMATOR_OFFSET_SPREAD][j]};
        double *const h = regressor + j * BODY_PARAMETERS;
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            h[k] *= through;
        }
        const double noise = e->parameter[ESTIMATOR_NOISE][j] / gated;
        const double load = LOAD_LAW * e->parameter[ESTIMATOR_LOAD][j] * payload[j];
        const double law = sqrt(FRICTION_LAW * friction * FRICTION_LAW * friction + load * load
                                + SIMULTANEOUS_S * rate[j] * SIMULTANEOUS_S * rate[j]);
        const joint_row added = {j, h, f, row->torque[j] - arm, 1.0 / (noise * noise), law};
        seen[count++] = filter_add_row(e, &added, counted);
    }
    change_watch(e, row->time, counted, seen, count);
    solve(e);
}

void estimator_update(payload_estimator *e, double time_s, const double *position, const double *effort)
{
    double sum = time_s;
    for (int j = 0; j < e->n; j++) {
        sum += fabs(position[j]) + fabs(effort[j]);
    }
    const int forgetting = e->noticing;
    if (forgetting) {
        e->noticing = 0;
        e->changed = e->noticed;
        e->change_mass = e->noticed_mass;
        e->changes += 1.0;
        forget_payload(e);
    }
    const double since = time_s - e->last_time;
    if (!(fabs(sum) < GREATEST_SUM) || (e->started && since <= 0.0 && since > -CLOCK_BACK_S)) {
        e->refused += 1.0;
        return;
    }
    if (e->started && since <= -CLOCK_BACK_S) {
        /* How long the clock stood is unknown: the next row counts as a memory later. The rows are kept, because the
           errors of the calibration act on the estimate through them. */
        e->row_time = -HUGE_VAL;
        for (int i = 0; i < e->remembered; i++) {
            e->row[i].time += since - e->memory_s;
        }
        e->touched_since = -HUGE_VAL;
        window_clear(e);
        change_clear(e);
    } else if (e->started) {
        int jumped = since > HOLE_S;
        for (int j = 0; j < e->n; j++) {
            jumped |= fabs(position[j] - e->last_position[j]) > JUMP_RAD + FASTEST_RAD_S * since;
        }
        if (jumped) {
            window_clear(e);
        }
    }
    e->started = 1;
    e->last_time = time_s;
    memcpy(e->last_position, position, (size_t)e->n * sizeof(double));
    if (e->gathered && time_s - e->gathering_since >= BIN_S) {
        window_close_mean(e);
        const double newest = e->smoothed[(e->next + SMOOTHED - 1) % SMOOTHED].time;
        if (!forgetting && newest - 0.5 * WINDOW_S - e->row_time >= ROW_S - EARLY_BINS * BIN_S) {
            take_row(e);
        }
    }
    if (!e->gathered) {
        memset(&e->gathering, 0, sizeof e->gathering);
        e->gathering_since = time_s;
    }
    e->gathering.time += time_s - e->gathering_since;
    for (int j = 0; j < e->n; j++) {
        double torque = 0.0;
        for (int k = 0; k < e->n; k++) {
            torque += effort[k] * e->from_effort[k * e->n + j];
        }
        e->gathering.position[j] += position[j];
        e->gathering.torque[j] += torque;
    }
    e->gathered++;
}

void estimator_read(const payload_estimator *e, double *theta, double *covariance, double *friction, double *moving_s,
                    double *status)
{
    double whole[BODY_PARAMETERS][BODY_PARAMETERS];
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        double column[BODY_PARAMETERS] = {0.0};
        column[k] = 1.0;
        solve_lower((const double(*)[BODY_PARAMETERS])e->factor, column);
        solve_upper((const double(*)[BODY_PARAMETERS])e->factor, column);
        for (int i = 0; i < BODY_PARAMETERS; i++) {
            whole[i][k] = column[i];
        }
        theta[k] = e->theta[k] * e->scale[k];
    }
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        for (int i = 0; i < BODY_PARAMETERS; i++) {
            covariance[k * BODY_PARAMETERS + i] = 0.5 * (whole[k][i] + whole[i][k]) * e->scale[k] * e->scale[i];
        }
    }
    for (int j = 0; j < e->n; j++) {
        for (int a = 0; a < FRICTION_STATES; a++) {
            friction[a * e->n + j] = e->joint[j].change[a] * e->parameter[ESTIMATOR_COULOMB_SPREAD + a][j];
        }
        moving_s[j] = e->moving_s[j];
    }
    status[ESTIMATOR_TIME] = e->last_time;
    status[ESTIMATOR_ROWS] = e->rows;
    status[ESTIMATOR_REFUSED] = e->refused;
    status[ESTIMATOR_MISFIT] = 1.0;
    for (int j = 0; j < e->n; j++) {
        status[ESTIMATOR_MISFIT] = fmax(status[ESTIMATOR_MISFIT], e->joint[j].misfit);
    }
    status[ESTIMATOR_CHANGE_TEST] = e->change_test;
    status[ESTIMATOR_CHANGES] = e->changes;
    status[ESTIMATOR_CHANGED] = e->changed;
    status[ESTIMATOR_CHANGE_MASS] = e->change_mass;
    status[ESTIMATOR_CONTACT_RATIO] = e->contact_ratio;
    status[ESTIMATOR_CONTACT] = e->touched_since > -HUGE_VAL && e->row_time - e->touched_since >= HELD_S ? 1.0 : 0.0;
}

void estimator_read_friction(const payload_estimator *e, double *covariance)
{
    for (int j = 0; j < e->n; j++) {
        double joint[FRICTION_STATES][FRICTION_STATES];
        filter_friction_covariance(e, e->joint + j, joint);
        for (int a = 0; a < FRICTION_STATES; a++) {
            for (int b = 0; b < FRICTION_STATES; b++) {
                *covariance++ = joint[a][b] * e->parameter[ESTIMATOR_COULOMB_SPREAD + a][j]
                                * e->parameter[ESTIMATOR_COULOMB_SPREAD + b][j];
            }
        }
    }
}
