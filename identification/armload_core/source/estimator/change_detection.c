#include "change_detection.h"

#include <math.h>
#include <string.h>

#include "estimator_numbers.h"
#include "small_matrices.h"

enum { STATIC = 4 }; /* parameters that act at rest: mass and centre of mass, the first of the body's */

void change_clear(payload_estimator *e)
{
    memset(e->change, 0, sizeof e->change);
    memset(e->change_right, 0, sizeof e->change_right);
    e->change_test = e->evidence = e->suspected = 0.0;
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
        own->learnt = filter_followed(own->learnt, size, elapsed, SCATTER_MEMORY_S, own->moved_s);
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

void change_watch(payload_estimator *e, double now, double counted, const surprise *seen, int count)
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
        change_clear(e);
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
        const double memory_s = fmin(LEVEL_MEMORY_S, FIRST_LEVEL_MEMORY_S + e->watched_s);
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
        change_clear(e);
        e->noticing = 1;
    }
}

void contact_watch(payload_estimator *e, const estimator_row *row, const double *links, const double *payload)
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
        worst = fmax(worst, fabs(row->torque[j] - carried) / fmax(held, LEAST_HELD_NM));
    }
    e->contact_ratio = worst;
    if (worst < CONTACT_RATIO) {
        e->touched_since = -HUGE_VAL;
    } else if (e->touched_since == -HUGE_VAL) {
        e->touched_since = row->time;
    }
}
