/* `armload export --format c` writes this file and its header for one arm, with straight-line code as `estimator_arm`.
   From the core they use only the two constants of `chain.h`. */
#include "payload_estimator.h"

#include <math.h>
#include <string.h>

static const double BIN_S = 0.0095;      /* samples that come faster are averaged over this */
static const double WINDOW_S = 0.24;     /* window of a cubic fit: a Savitzky-Golay filter for irregular time stamps */
static const double DEVIATION = 0.1889822365046136; /* standard deviation of its kernel over WINDOW_S: sqrt(1/28) */
static const double ROW_S = 0.05;
static const double HOLE_S = 0.10;       /* after a longer gap between samples the front end restarts */
static const double CLOCK_BACK_S = 1.0;  /* a stamp earlier by this or more means that the clock was set */
static const double FASTEST_RAD_S = 20.0; /* no joint is faster: a faster change of position is a jump */
static const double JUMP_RAD = 0.02;
static const double LEAST_WEIGHT = 0.05;
static const double ONWARD = 0.95;       /* least share of the window in one direction for a row to count */
static const double CLIP = 3.0;          /* innovations are limited to this many standard deviations */
static const double MISFIT_MEMORY_S = 10.0;
static const double SCATTER_MEMORY_S = 2.0;
static const double WAIT_S = 0.25;       /* a scatter comes into use after three of these intervals */
static const double USUAL_SCATTER = 2.0; /* of a calibrated arm; the test for changes allows for the excess over it */
static const double FIRST_MEMORY_S = 0.5; /* memories grow from this with the joint's time of motion */
static const double USUAL_MISFIT = 10.0; /* the test also allows for a misfit above this */
static const double SCATTER_COLOUR = 3.0; /* errors of the model are correlated for longer than noise */
static const double FRICTION_LAW = 0.01; /* error of the friction model, as a share of friction, that the test allows */
static const double LOAD_LAW = 0.25;     /* the same of the load-dependent friction that is due to the payload */
static const double SIMULTANEOUS_S = 0.002; /* error of the torque's delay that the test allows */
static const double CHANGE_MEMORY_S = 1.0;
static const double CHANGE_TEST = 20.0;
static const double STATIC_TEST = 8.0;   /* of mass and centre of mass, for any inertia, on an arm like its model */
static const double STATIC_MOST = 20.0;  /* on any other arm */
static const double USUAL_LEVEL = 1.1;   /* mean of that test on an arm like its model */
static const double LEVEL_MEMORY_S = 20.0;
static const double COMPACT = 30.0;      /* prior information on a change's inertia: 0.13 m of lever; payload: 0.3 m */
static const double KNOWN_S = 5.0;       /* time of motion before the first test, for an estimate of the scatter */
static const double ANEW_S = 2.0;        /* time of motion before the next test, for an estimate of the payload */
static const double HELD_S = 0.3;        /* at the bound; at twice the significance half of it is enough */
static const double AT_REST = 0.05;      /* as a share of the gate's speed */
static const double CONTACT_RATIO = 3.0; /* over modelled friction: at most 1.4 on a free arm, 6 and more in a push */

enum { LEAST_MEANS = 5, POWERS = 4, STATIC = 4 };

static void clear_payload(payload_estimator *e)
{
    for (int j = 0; j < e->n; j++) {
        memset(e->joint[j].payload, 0, sizeof e->joint[j].payload);
        memset(e->joint[j].payload_right, 0, sizeof e->joint[j].payload_right);
    }
}

static void clear_change(payload_estimator *e)
{
    memset(e->change, 0, sizeof e->change);
    memset(e->change_right, 0, sizeof e->change_right);
    e->change_test = e->evidence = e->suspected = 0.0;
}

static void clear_front(payload_estimator *e)
{
    e->held = e->next = e->gathered = 0;
}

/* Cholesky factor of a 10 x 10 matrix, in place. Returns 0 if it is not positive definite. */
static int factorised(double (*a)[BODY_PARAMETERS])
{
    for (int j = 0; j < BODY_PARAMETERS; j++) {
        double d = a[j][j];
        for (int k = 0; k < j; k++) {
            d -= a[j][k] * a[j][k];
        }
        if (!(d > 0.0)) {
            return 0;
        }
        const double root = sqrt(d);
        a[j][j] = root;
        for (int i = j + 1; i < BODY_PARAMETERS; i++) {
            double s = a[i][j];
            for (int k = 0; k < j; k++) {
                s -= a[i][k] * a[j][k];
            }
            a[i][j] = s / root;
        }
    }
    return 1;
}

static void solve_lower(const double (*l)[BODY_PARAMETERS], double *x)
{
    for (int i = 0; i < BODY_PARAMETERS; i++) {
        for (int k = 0; k < i; k++) {
            x[i] -= l[i][k] * x[k];
        }
        x[i] /= l[i][i];
    }
}

static void solve_upper(const double (*l)[BODY_PARAMETERS], double *x)
{
    for (int i = BODY_PARAMETERS - 1; i >= 0; i--) {
        for (int k = i + 1; k < BODY_PARAMETERS; k++) {
            x[i] -= l[k][i] * x[k];
        }
        x[i] /= l[i][i];
    }
}

/* Inverse of a symmetric positive definite 3 x 3 matrix. */
static void inverted(const double (*a)[FRICTION_STATES], double (*inverse)[FRICTION_STATES])
{
    const double c00 = a[1][1] * a[2][2] - a[1][2] * a[1][2], c01 = a[0][2] * a[1][2] - a[0][1] * a[2][2];
    const double c02 = a[0][1] * a[1][2] - a[0][2] * a[1][1];
    const double scale = 1.0 / (a[0][0] * c00 + a[0][1] * c01 + a[0][2] * c02);
    inverse[0][0] = scale * c00;
    inverse[0][1] = inverse[1][0] = scale * c01;
    inverse[0][2] = inverse[2][0] = scale * c02;
    inverse[1][1] = scale * (a[0][0] * a[2][2] - a[0][2] * a[0][2]);
    inverse[1][2] = inverse[2][1] = scale * (a[0][1] * a[0][2] - a[0][0] * a[1][2]);
    inverse[2][2] = scale * (a[0][0] * a[1][1] - a[0][1] * a[0][1]);
}

/* Coupling of the payload with a joint's friction, B D^-1 (10, 3), with the misfit in both factors. */
static void through_friction(const joint_information *f, double (*through)[FRICTION_STATES])
{
    const double counts = 1.0 / f->misfit;
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        for (int a = 0; a < FRICTION_STATES; a++) {
            through[k][a] = counts
                            * (f->with_payload[k][0] * f->inverse[0][a] + f->with_payload[k][1] * f->inverse[1][a]
                               + f->with_payload[k][2] * f->inverse[2][a]);
        }
    }
}

/* Compute the estimates. All rows of a joint, including old ones, are weighted by its misfit. */
static void solve(payload_estimator *e)
{
    double right[BODY_PARAMETERS] = {0.0}, through[BODY_PARAMETERS][FRICTION_STATES];
    memset(e->factor, 0, sizeof e->factor);
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        e->factor[k][k] = 1.0;
    }
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        const double counts = 1.0 / f->misfit;
        double own[FRICTION_STATES][FRICTION_STATES];
        for (int a = 0; a < FRICTION_STATES; a++) {
            for (int b = 0; b < FRICTION_STATES; b++) {
                own[a][b] = (a == b ? 1.0 : 0.0) + counts * f->own[a][b];
            }
        }
        inverted((const double(*)[FRICTION_STATES])own, f->inverse);
        through_friction(f, through);
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            for (int i = 0; i <= k; i++) {
                e->factor[k][i] += counts
                                   * (f->payload[k][i] - through[k][0] * f->with_payload[i][0]
                                      - through[k][1] * f->with_payload[i][1] - through[k][2] * f->with_payload[i][2]);
            }
            right[k] += counts
                        * (f->payload_right[k] - through[k][0] * f->right[0] - through[k][1] * f->right[1]
                           - through[k][2] * f->right[2]);
        }
    }
    if (!factorised(e->factor)) {
        estimator_begin(e); /* only if the information is not finite, which must not persist */
        return;
    }
    solve_lower((const double(*)[BODY_PARAMETERS])e->factor, right);
    solve_upper((const double(*)[BODY_PARAMETERS])e->factor, right);
    memcpy(e->theta, right, sizeof e->theta);
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        const double counts = 1.0 / f->misfit;
        double left[FRICTION_STATES];
        for (int a = 0; a < FRICTION_STATES; a++) {
            left[a] = f->right[a];
            for (int k = 0; k < BODY_PARAMETERS; k++) {
                left[a] -= f->with_payload[k][a] * e->theta[k];
            }
            left[a] *= counts;
        }
        for (int a = 0; a < FRICTION_STATES; a++) {
            f->change[a] = f->inverse[a][0] * left[0] + f->inverse[a][1] * left[1] + f->inverse[a][2] * left[2];
        }
    }
}

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
    clear_front(e);
    clear_change(e);
    e->watched_s = e->waited_s = e->level = 0.0;
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        f->misfit = f->scatter = f->learnt = 1.0;
        for (int i = 0; i < WAITING; i++) {
            f->waiting[i] = 1.0;
        }
    }
    solve(e);
}

/* Covariance of the changes of a joint's friction, payload unknown, in the units of the states. */
static void friction_covariance(const payload_estimator *e, const joint_information *f,
                                double (*covariance)[FRICTION_STATES])
{
    double through[BODY_PARAMETERS][FRICTION_STATES];
    through_friction(f, through);
    memcpy(covariance, f->inverse, sizeof f->inverse);
    for (int a = 0; a < FRICTION_STATES; a++) {
        double column[BODY_PARAMETERS];
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            column[k] = through[k][a];
        }
        solve_lower((const double(*)[BODY_PARAMETERS])e->factor, column);
        solve_upper((const double(*)[BODY_PARAMETERS])e->factor, column);
        for (int b = 0; b <= a; b++) {
            double sum = 0.0;
            for (int k = 0; k < BODY_PARAMETERS; k++) {
                sum += column[k] * through[k][b];
            }
            covariance[a][b] += sum;
            if (b < a) {
                covariance[b][a] = covariance[a][b];
            }
        }
    }
}

/* Another payload: nothing is known of it, and of each joint's friction what was known beside the old one. */
static void forget_payload(payload_estimator *e)
{
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        double covariance[FRICTION_STATES][FRICTION_STATES];
        friction_covariance(e, f, covariance);
        inverted((const double(*)[FRICTION_STATES])covariance, f->own);
        memset(f->with_payload, 0, sizeof f->with_payload);
        for (int a = 0; a < FRICTION_STATES; a++) {
            f->right[a] = f->misfit
                          * (f->own[a][0] * f->change[0] + f->own[a][1] * f->change[1] + f->own[a][2] * f->change[2]);
        }
        for (int a = 0; a < FRICTION_STATES; a++) {
            for (int b = 0; b < FRICTION_STATES; b++) {
                /* what was known beforehand is not stored, and rounding must not make the rest negative */
                f->own[a][b] = f->misfit * (a == b ? fmax(f->own[a][b] - 1.0, 0.0) : f->own[a][b]);
            }
        }
    }
    clear_payload(e);
    clear_change(e);
    e->watched_s = fmin(e->watched_s, KNOWN_S - ANEW_S);
    e->remembered = e->next_row = 0;
    memset(e->moving_s, 0, sizeof e->moving_s);
    solve(e);
}

/* Row at the middle of the window: acceleration from a least-squares cubic, the other signals filtered to match.
   Returns 0 if the window has too few samples. */
static int smoothed_row(const payload_estimator *e, estimator_row *row)
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
    if (!(half > 0.3 * WINDOW_S)) {
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
            if (i == j && !(s > 1e-9)) {
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
    if (!(whole > 0.5)) { /* 1 up to rounding */
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

static void fade(payload_estimator *e, double elapsed)
{
    const double kept = exp(-elapsed / e->memory_s), change = exp(-elapsed / CHANGE_MEMORY_S);
    for (int i = 0; i < BODY_PARAMETERS; i++) {
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            e->change[i][k] *= change;
        }
        e->change_right[i] *= change;
    }
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            for (int i = 0; i <= k; i++) {
                f->payload[k][i] *= kept;
            }
            for (int a = 0; a < FRICTION_STATES; a++) {
                f->with_payload[k][a] *= kept;
            }
            f->payload_right[k] *= kept;
        }
        for (int a = 0; a < FRICTION_STATES; a++) {
            for (int b = 0; b < FRICTION_STATES; b++) {
                f->own[a][b] *= kept;
            }
            f->right[a] *= kept;
        }
        e->moving_s[j] *= kept;
    }
}

/* A joint's row for the test for changes: its innovation, and the innovation's expected square. */
typedef struct {
    int joint;
    double innovation, usual;
    const double *h;
} surprise;

/* The level of a joint's squared errors after a row with `size` times it: a mean at first, then with a fixed memory. */
static double followed(double level, double size, double elapsed, double memory_s, double moved_s)
{
    const double grown_s = fmin(memory_s, FIRST_MEMORY_S + moved_s);
    return fmax(level * (1.0 + elapsed / grown_s * (size - 1.0)), 1.0);
}

/* Add a joint's row to the information; `h` and `f` in the units of the states, `law` the model's error that the test for
   changes allows. */
static void add_row(payload_estimator *e, int joint, const double *h, const double *f, double law, double target,
                    double weight, double elapsed, surprise *seen)
{
    joint_information *own = e->joint + joint;
    double expected = 0.0, open[BODY_PARAMETERS], by[FRICTION_STATES], variance = 0.0;
    for (int a = 0; a < FRICTION_STATES; a++) {
        by[a] = own->inverse[a][0] * f[0] + own->inverse[a][1] * f[1] + own->inverse[a][2] * f[2];
        expected += f[a] * own->change[a];
        variance += f[a] * by[a];
    }
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        expected += h[k] * e->theta[k];
        open[k] = h[k]
                  - (own->with_payload[k][0] * by[0] + own->with_payload[k][1] * by[1]
                     + own->with_payload[k][2] * by[2]) / own->misfit;
    }
    solve_lower((const double(*)[BODY_PARAMETERS])e->factor, open);
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        variance += open[k] * open[k];
    }
    const double excess = fmax(fmax(own->scatter - USUAL_SCATTER, own->misfit - USUAL_MISFIT), 0.0);
    const double spread = (1.0 + SCATTER_COLOUR * excess) / weight + variance + law * law;
    const double bound = CLIP * sqrt(spread);
    const double off = target - expected, innovation = fmax(fmin(off, bound), -bound);
    /* The weight is reduced for correlated rows; an innovation's size, however, is that of a single row's noise. */
    const double single = 1.0 / (weight * e->parameter[ESTIMATOR_COLOUR][joint]);
    if (e->suspected == 0.0) {
        const double size = innovation * innovation / (own->misfit * single + variance);
        own->misfit = followed(own->misfit, size, elapsed, MISFIT_MEMORY_S, own->moved_s);
    }
    *seen = (surprise){joint, innovation, own->learnt * single + variance, h};
    const double counts = weight * (expected + innovation);
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        const double wh = weight * h[k], ch = h[k] / spread;
        for (int i = 0; i < BODY_PARAMETERS; i++) {
            e->change[k][i] += ch * h[i];
        }
        for (int i = 0; i <= k; i++) {
            own->payload[k][i] += wh * h[i];
        }
        for (int a = 0; a < FRICTION_STATES; a++) {
            own->with_payload[k][a] += wh * f[a];
        }
        own->payload_right[k] += counts * h[k];
        e->change_right[k] += ch * innovation;
    }
    for (int a = 0; a < FRICTION_STATES; a++) {
        for (int b = 0; b < FRICTION_STATES; b++) {
            own->own[a][b] += weight * f[a] * f[b];
        }
        own->right[a] += counts * f[a];
    }
}

/* Estimate the scatter of the rows, without a suspected change. The scatter in use is that of 0.75 to 1 s ago. */
static void learn_scatter(payload_estimator *e, const surprise *seen, int count, const double *change, double elapsed)
{
    for (int i = 0; i < count; i++) {
        joint_information *own = e->joint + seen[i].joint;
        double left = seen[i].innovation;
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            left -= seen[i].h[k] * change[k];
        }
        const double size = left * left / seen[i].usual;
        own->learnt = followed(own->learnt, size, elapsed, SCATTER_MEMORY_S, own->moved_s);
        own->moved_s += elapsed;
    }
    e->waited_s += elapsed;
    if (e->waited_s < WAIT_S) {
        return;
    }
    e->waited_s = 0.0;
    for (int j = 0; j < e->n; j++) {
        joint_information *own = e->joint + j;
        own->scatter = own->waiting[0];
        memmove(own->waiting, own->waiting + 1, sizeof own->waiting - sizeof own->waiting[0]);
        own->waiting[WAITING - 1] = own->learnt;
    }
}

/* Test for a change of payload: the change from the innovations of the last second, and its significance. */
static void watch_change(payload_estimator *e, double now, double counted, const surprise *seen, int count)
{
    enum { INERTIA = BODY_PARAMETERS - STATIC };
    double factor[BODY_PARAMETERS][BODY_PARAMETERS], change[BODY_PARAMETERS], found[BODY_PARAMETERS] = {0.0};
    /* The inertia first: the rest of the sum of squares belongs to mass and centre of mass, for any inertia. */
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        const int from = (k + STATIC) % BODY_PARAMETERS;
        for (int i = 0; i < BODY_PARAMETERS; i++) {
            factor[k][i] = e->change[from][(i + STATIC) % BODY_PARAMETERS];
        }
        factor[k][k] += k < INERTIA ? COMPACT : 1.0;
        change[k] = e->change_right[from];
    }
    if (!factorised(factor)) {
        clear_change(e);
        return;
    }
    solve_lower((const double(*)[BODY_PARAMETERS])factor, change);
    double of_all = 0.0, of_static = 0.0;
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        of_all += change[k] * change[k];
        of_static += k < INERTIA ? 0.0 : change[k] * change[k];
    }
    /* The bound follows the statistic's own mean, which model errors raise without a change of payload. */
    const double needed = fmin(STATIC_TEST * fmax(e->level / USUAL_LEVEL, 1.0), STATIC_MOST);
    const int significant = of_all > CHANGE_TEST && of_static > needed;
    if (significant) {
        solve_upper((const double(*)[BODY_PARAMETERS])factor, change);
        for (int k = 0; k < BODY_PARAMETERS; k++) {
            found[(k + STATIC) % BODY_PARAMETERS] = change[k];
        }
    }
    learn_scatter(e, seen, count, found, counted);
    if (count) {
        e->watched_s += counted;
        const double memory_s = fmin(LEVEL_MEMORY_S, 1.0 + e->watched_s);
        e->level += counted / memory_s * (fmin(of_static, STATIC_TEST) - e->level);
    }
    e->change_test = e->watched_s < KNOWN_S || of_static <= needed ? 0.0 : of_all;
    /* The first row above the bound starts the evidence; a gap between rows adds no more than one row. */
    if (e->change_test <= CHANGE_TEST) {
        e->evidence = e->suspected = 0.0;
        return;
    }
    e->evidence += e->suspected * e->change_test * counted;
    e->suspected = 1.0;
    if (e->evidence >= CHANGE_TEST * HELD_S) {
        /* The next sample forgets the payload: together with a row it would be by far the longest update. */
        e->noticed = now;
        e->noticed_mass = found[0] * e->scale[0];
        clear_change(e);
        e->noticing = 1;
    }
}

/* At rest the unexplained torque is friction; more than friction can hold is contact. */
static void watch_contact(payload_estimator *e, const estimator_row *row, const double *links, const double *payload)
{
    double worst = 0.0;
    for (int j = 0; j < e->n; j++) {
        if (fabs(row->velocity[j]) > AT_REST * e->parameter[ESTIMATOR_GATE][j]) {
            e->contact_ratio = 0.0;
            e->touched_since = -HUGE_VAL;
            return;
        }
        const double carried = links[j] + payload[j];
        const double held = e->parameter[ESTIMATOR_COULOMB][j] + e->parameter[ESTIMATOR_LOAD][j] * fabs(carried);
        worst = fmax(worst, fabs(row->torque[j] - carried) / fmax(held, 1e-9));
    }
    e->contact_ratio = worst;
    if (worst < CONTACT_RATIO) {
        e->touched_since = -HUGE_VAL;
    } else if (e->touched_since == -HUGE_VAL) {
        e->touched_since = row->time;
    }
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
    if (!smoothed_row(e, row)) {
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
    watch_contact(e, row, links, payload);
    fade(e, elapsed);
    const double counted = fmin(elapsed, 2.0 * ROW_S);
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
        add_row(e, j, h, f, law, row->torque[j] - arm, 1.0 / (noise * noise), counted, seen + count++);
    }
    watch_change(e, row->time, counted, seen, count);
    solve(e);
}

/* Store the mean of the gathered samples in the window. */
static void close_mean(payload_estimator *e)
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
    if (!(fabs(sum) < 1e12) || (e->started && since <= 0.0 && since > -CLOCK_BACK_S)) {
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
        clear_front(e);
        clear_change(e);
    } else if (e->started) {
        int jumped = since > HOLE_S;
        for (int j = 0; j < e->n; j++) {
            jumped |= fabs(position[j] - e->last_position[j]) > JUMP_RAD + FASTEST_RAD_S * since;
        }
        if (jumped) {
            clear_front(e);
        }
    }
    e->started = 1;
    e->last_time = time_s;
    memcpy(e->last_position, position, (size_t)e->n * sizeof(double));
    if (e->gathered && time_s - e->gathering_since >= BIN_S) {
        close_mean(e);
        const double newest = e->smoothed[(e->next + SMOOTHED - 1) % SMOOTHED].time;
        if (!forgetting && newest - 0.5 * WINDOW_S - e->row_time >= ROW_S - 0.5 * BIN_S) {
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
        friction_covariance(e, e->joint + j, joint);
        for (int a = 0; a < FRICTION_STATES; a++) {
            for (int b = 0; b < FRICTION_STATES; b++) {
                *covariance++ = joint[a][b] * e->parameter[ESTIMATOR_COULOMB_SPREAD + a][j]
                                * e->parameter[ESTIMATOR_COULOMB_SPREAD + b][j];
            }
        }
    }
}
