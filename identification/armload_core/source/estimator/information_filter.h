/* Information about payload and friction: adding rows, forgetting, and the estimates. */

#ifndef ARMLOAD_INFORMATION_FILTER_H
#define ARMLOAD_INFORMATION_FILTER_H

#include "payload_estimator.h"

/* A joint's row: target = h theta + f change + noise, all in the units of the states. */
typedef struct {
    int joint;
    const double *h;       /* (BODY_PARAMETERS) */
    const double *f;       /* (FRICTION_STATES) */
    double target, weight; /* N m, and one over the variance of its noise */
    double law;            /* N m, the model's error that the test for changes allows */
} joint_row;

/* The same row for the test for changes: its innovation, and the innovation's expected square. */
typedef struct {
    int joint;
    double innovation, usual;
    const double *h;
} surprise;

/* Compute the estimates. All rows of a joint, including old ones, are weighted by its misfit. Returns 0 if
   the information is not finite; the estimator must then begin anew. */
int filter_solve(payload_estimator *e);

/* Covariance of the changes of a joint's friction, payload unknown, in the units of the states. */
void filter_friction_covariance(const payload_estimator *e, const joint_information *f,
                                double (*covariance)[FRICTION_STATES]);

/* Forget the payload; of each joint's friction, what was known beside it is kept. */
void filter_forget_payload(payload_estimator *e);

/* Forget exponentially what is `elapsed` seconds older. */
void filter_fade(payload_estimator *e, double elapsed);

/* Add a joint's row to the information, `elapsed` seconds after the one before. */
surprise filter_add_row(payload_estimator *e, const joint_row *row, double elapsed);

/* The level of a joint's squared errors after a row with `size` times it: a mean at first, then with a fixed memory. */
double filter_followed(double level, double size, double elapsed, double memory_s, double moved_s);

#endif
