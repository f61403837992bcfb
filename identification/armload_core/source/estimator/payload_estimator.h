/* Recursive estimator of an arm's payload, sample by sample. It allocates no memory and takes bounded time.

   Row of joint j, at most 20 per second: measured torque minus the calibrated arm's own,

       tau - tau_arm = (1 + mu s sgn(tau_l)) Phi_j theta + s dFc_j + dq_j dFv_j + dF0_j

   The unknowns are the payload's ten parameters theta and three changes of friction per joint, in units of their prior
   standard deviations, so that the prior information is the identity. With exponential forgetting towards the prior,

       Lambda = 1 + sum_j L_j / c_j,      L_j <- f L_j + W_j h_j h_j^T,      f = exp(-dt / memory)

   Lambda - 1 is positive semidefinite for any data, rounding and number of updates. A joint's friction is coupled with
   the payload only: Lambda is an arrow matrix, and theta follows from one factorisation of a 10 x 10 matrix. The misfit
   c_j >= 1 is the ratio of the mean square of the joint's innovations to the expected one: all rows of a joint that no
   payload explains, including old ones, get less weight, and the intervals widen.

   A change of payload shows in the innovations of the last second. They are compared with the joint's scatter, a misfit
   with a memory of seconds, as it was a second ago: a change is detected before it counts as scatter. The oscillation
   of an elastic joint looks like a change of inertia; therefore a change must also show in mass and centre of mass.
   Errors of the model look like a change for as long as the arm keeps its direction; what remains of them after the
   misfit is allowed for raises the mean of the test over 20 s, and with it the bound. */

#ifndef ARMLOAD_PAYLOAD_ESTIMATOR_H
#define ARMLOAD_PAYLOAD_ESTIMATOR_H

#include "chain.h"

/* Rows of the arm's constants, (ESTIMATOR_PARAMETERS, n). */
#define ESTIMATOR_PARAMETER_ROWS(ROW)                                                                                  \
    ROW(COULOMB)                                                                                                       \
    ROW(VISCOUS)                                                                                                       \
    ROW(ROOT)                                                                                                          \
    ROW(LOAD)                                                                                                          \
    ROW(REVERSAL)                                                                                                      \
    ROW(GATE)                                                                                                          \
    ROW(NOISE)                                                                                                         \
    ROW(COLOUR)                                                                                                        \
    ROW(COULOMB_SPREAD)                                                                                                 \
    ROW(VISCOUS_SPREAD)                                                                                                 \
    ROW(OFFSET_SPREAD)

/* Rows of the status. */
#define ESTIMATOR_STATUS_ROWS(ROW)                                                                                     \
    ROW(TIME)                                                                                                          \
    ROW(ROWS)                                                                                                          \
    ROW(REFUSED)                                                                                                       \
    ROW(MISFIT)                                                                                                        \
    ROW(CHANGE_TEST)                                                                                                   \
    ROW(CHANGES)                                                                                                       \
    ROW(CHANGED)                                                                                                       \
    ROW(CHANGE_MASS)                                                                                                   \
    ROW(CONTACT_RATIO)                                                                                                 \
    ROW(CONTACT)

#define ESTIMATOR_NAME(name) ESTIMATOR_##name,
enum { ESTIMATOR_PARAMETER_ROWS(ESTIMATOR_NAME) ESTIMATOR_PARAMETERS };
enum { ESTIMATOR_STATUS_ROWS(ESTIMATOR_NAME) ESTIMATOR_STATUS };
#undef ESTIMATOR_NAME

/* Rows of 20 s, for the sensitivity to gains and body. An export, which does not compute it, keeps only the last. */
#ifndef REMEMBERED_ROWS
#define REMEMBERED_ROWS 400
#endif

enum {
    FRICTION_STATES = 3, /* changes of Coulomb friction, viscous friction and offset */
    WAITING = 3,         /* scatters not yet in use */
    SMOOTHED = 40        /* greatest number of 10 ms means in the front end; a window holds 25 */
};

typedef struct {
    double time, position[MOST_JOINTS], torque[MOST_JOINTS];
} joint_sample;

typedef struct {
    double time, position[MOST_JOINTS], velocity[MOST_JOINTS], acceleration[MOST_JOINTS], torque[MOST_JOINTS];
    double jerk[MOST_JOINTS], direction[MOST_JOINTS];
} estimator_row;

/* Information from a joint's rows about the payload, its friction and both, without the prior; the resulting changes of
   friction; and its misfit. */
typedef struct {
    double payload[BODY_PARAMETERS][BODY_PARAMETERS], payload_right[BODY_PARAMETERS]; /* lower half */
    double own[FRICTION_STATES][FRICTION_STATES], with_payload[BODY_PARAMETERS][FRICTION_STATES];
    double right[FRICTION_STATES], change[FRICTION_STATES], inverse[FRICTION_STATES][FRICTION_STATES];
    double misfit, moved_s;
    double scatter, waiting[WAITING], learnt; /* in use, waiting, and newest */
} joint_information;

typedef struct {
    int n; /* number of joints; 0 before initialisation */
    double from_effort[MOST_JOINTS * MOST_JOINTS], rotors[MOST_JOINTS * MOST_JOINTS];
    double parameter[ESTIMATOR_PARAMETERS][MOST_JOINTS], scale[BODY_PARAMETERS];
    double memory_s, delay_s;

    /* front end */
    int started, held, next, gathered;
    double last_time, last_position[MOST_JOINTS], gathering_since, row_time;
    joint_sample gathering, smoothed[SMOOTHED];

    /* payload and friction */
    double theta[BODY_PARAMETERS], factor[BODY_PARAMETERS][BODY_PARAMETERS];
    joint_information joint[MOST_JOINTS];
    double moving_s[MOST_JOINTS];

    /* change of payload, and contact */
    double change[BODY_PARAMETERS][BODY_PARAMETERS], change_right[BODY_PARAMETERS];
    int noticing; /* whether a change was detected, but the old payload not forgotten yet */
    double noticed, noticed_mass;
    double watched_s, waited_s; /* time of motion, and since the scatters were shifted */
    double level; /* mean of the test of mass and centre of mass */
    double change_test, suspected, evidence, changed, change_mass, changes;
    double contact_ratio, touched_since;

    double rows, refused;
    int remembered, next_row;
    estimator_row row[REMEMBERED_ROWS];
} payload_estimator;

/* Reset the estimator; keeps the constants. */
void estimator_begin(payload_estimator *e);

/* Process a sample: joint positions in rad, and efforts as the drives report them. */
void estimator_update(payload_estimator *e, double time_s, const double *position, const double *effort);

/* Parameters (10), their covariance (10, 10), changes of friction (3, n), status. */
void estimator_read(const payload_estimator *e, double *theta, double *covariance, double *friction, double *moving_s,
                    double *status);

/* Covariance of each joint's changes of friction (n, 3, 3). */
void estimator_read_friction(const payload_estimator *e, double *covariance);

/* Defined by the program that uses the estimator: the payload's regressor (n, 10) and the torque of the links (n). */
void estimator_arm(const payload_estimator *e, const double *position, const double *velocity,
                   const double *acceleration, double *regressor, double *links);

#endif
