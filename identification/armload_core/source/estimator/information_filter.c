#include "information_filter.h"

#include <math.h>
#include <string.h>

#include "estimator_numbers.h"
#include "small_matrices.h"

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

int filter_solve(payload_estimator *e)
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
        return 0;
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
    return 1;
}

void filter_friction_covariance(const payload_estimator *e, const joint_information *f,
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

void filter_forget_payload(payload_estimator *e)
{
    for (int j = 0; j < e->n; j++) {
        joint_information *f = e->joint + j;
        double covariance[FRICTION_STATES][FRICTION_STATES];
        filter_friction_covariance(e, f, covariance);
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
        memset(f->payload, 0, sizeof f->payload);
        memset(f->payload_right, 0, sizeof f->payload_right);
    }
}

void filter_fade(payload_estimator *e, double elapsed)
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

double filter_followed(double level, double size, double elapsed, double memory_s, double moved_s)
{
    const double grown_s = fmin(memory_s, FIRST_MEMORY_S + moved_s);
    return fmax(level * (1.0 + elapsed / grown_s * (size - 1.0)), 1.0);
}

surprise filter_add_row(payload_estimator *e, const joint_row *row, double elapsed)
{
    joint_information *own = e->joint + row->joint;
    const double *const h = row->h, *const f = row->f;
    const double weight = row->weight;
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
    const double spread = (1.0 + SCATTER_COLOUR * excess) / weight + variance + row->law * row->law;
    const double bound = CLIP * sqrt(spread);
    const double off = row->target - expected, innovation = fmax(fmin(off, bound), -bound);
    /* The weight is reduced for correlated rows; an innovation's size, however, is that of a single row's noise. */
    const double single = 1.0 / (weight * e->parameter[ESTIMATOR_COLOUR][row->joint]);
    if (e->suspected == 0.0) {
        const double size = innovation * innovation / (own->misfit * single + variance);
        own->misfit = filter_followed(own->misfit, size, elapsed, MISFIT_MEMORY_S, own->moved_s);
    }
    const surprise seen = {row->joint, innovation, own->learnt * single + variance, h};
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
    return seen;
}
