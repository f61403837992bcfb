/* What an arm carries, sample by sample: the recursive estimator. It allocates nothing and takes bounded time.

   Row of joint j, at most 20 a second, of the calibrated arm's torque less what was measured:

       tau - tau_arm = (1 + mu s sgn(tau_l)) Phi_j theta + s dFc_j + dq_j dFv_j + dF0_j

   Unknown are the payload's ten parameters theta and three changes of friction per joint, in units of their standard
   deviations beforehand, so that the information about them begins as the identity. It fades towards that:

       Lambda = 1 + sum_j L_j / c_j,      L_j <- f L_j + W_j h_j h_j^T,      f = exp(-dt / memory)

   so that Lambda - 1 is never negative, whatever comes in: no rounding and no number of updates makes it indefinite.
   A joint's friction meets the payload alone: Lambda is an arrow, and theta follows from one factorisation of 10 x 10.
   The misfit c_j >= 1 is the mean square of the joint's innovations over what it should be: a joint that no payload
   explains counts less, in what it has shown before as well, and the intervals widen.

   A change of payload shows in the innovations of the last second. What they are measured by is the joint's scatter, a
   misfit that is learnt within seconds and used as it was a second ago: a change is noticed before it counts as scatter.
   An elastic joint that rings looks like inertia that changes; mass and centre of mass must show a part of any change. */

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

/* What the estimator says of itself. */
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

/* What the sensitivity to gains and body is computed from: 20 s. An export, which does not, keeps the last. */
#ifndef REMEMBERED_ROWS
#define REMEMBERED_ROWS 400
#endif

enum {
    FRICTION_STATES = 3,
    WAITING = 3, /* scatters that were learnt and are not used yet */
    SMOOTHED = 40 /* means over 10 ms that the front end holds at most */
};

typedef struct {
    double time, position[MOST_JOINTS], torque[MOST_JOINTS];
} joint_sample;

typedef struct {
    double time, position[MOST_JOINTS], velocity[MOST_JOINTS], acceleration[MOST_JOINTS], torque[MOST_JOINTS];
    double direction[MOST_JOINTS];
} estimator_row;

/* What a joint's rows say of the payload, of its friction and of both, without what was known beforehand; what follows
   for its friction; and by how much more than expected it is off. */
typedef struct {
    double payload[BODY_PARAMETERS][BODY_PARAMETERS], payload_right[BODY_PARAMETERS]; /* lower half */
    double own[FRICTION_STATES][FRICTION_STATES], with_payload[BODY_PARAMETERS][FRICTION_STATES];
    double right[FRICTION_STATES], change[FRICTION_STATES], inverse[FRICTION_STATES][FRICTION_STATES];
    double misfit;
    double scatter, waiting[WAITING], learnt; /* in use, to be used next, and up to now */
} joint_information;

typedef struct {
    int n; /* 0 before it is made */
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
    int noticing; /* a change is noticed, and the old payload not forgotten yet */
    double noticed, noticed_mass;
    double watched_s, waited_s; /* time of motion, and since the scatters moved on */
    double change_test, suspected, evidence, changed, change_mass, changes;
    double contact_ratio, touched_since;

    double rows, refused;
    int remembered, next_row;
    estimator_row row[REMEMBERED_ROWS];
} payload_estimator;

/* Begin anew with the constants that are there. */
void estimator_begin(payload_estimator *e);

/* Take a sample: joint positions in rad, and efforts as the drives report them. */
void estimator_update(payload_estimator *e, double time_s, const double *position, const double *effort);

/* Parameters (10), their covariance (10, 10), changes of friction (3, n), status. */
void estimator_read(const payload_estimator *e, double *theta, double *covariance, double *friction, double *moving_s,
                    double *status);

/* Given by whoever builds the estimator: the payload's regressor (n, 10) and the torque of the arm's own links (n). */
void estimator_arm(const payload_estimator *e, const double *position, const double *velocity,
                   const double *acceleration, double *regressor, double *links);

#endif
