/* Information about payload and friction: adding rows, forgetting, and the estimates. */

static const double CLIP = 3.0;          /* innovations are limited to this many standard deviations */
static const double USUAL_SCATTER = 2.0; /* of a calibrated arm; the test for changes allows for the excess over it */
static const double USUAL_MISFIT = 10.0; /* the test also allows for a misfit above this */
static const double SCATTER_COLOUR = 3.0; /* errors of the model are correlated for longer than noise */
static const double FIRST_MEMORY_S = 0.5; /* memories grow from this with the joint's time of motion */
static const double MISFIT_MEMORY_S = 10.0;
static const double CHANGE_MEMORY_S = 1.0;

static void clear_payload(payload_estimator *e)
{
    for (int j = 0; j < e->n; j++) {
        memset(e->joint[j].payload, 0, sizeof e->joint[j].payload);
        memset(e->joint[j].payload_right, 0, sizeof e->joint[j].payload_right);
    }
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
