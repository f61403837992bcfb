/* Detection of another payload and of contact. */

#ifndef ARMLOAD_CHANGE_DETECTION_H
#define ARMLOAD_CHANGE_DETECTION_H

#include "information_filter.h"
#include "payload_estimator.h"

/* Forget what the last second's innovations say about a change. */
void change_clear(payload_estimator *e);

/* Test for a change of payload: the change from the innovations of the last second, and its significance. `now` is the
   row's time stamp, `counted` the time that the row counts for, in s. */
void change_watch(payload_estimator *e, double now, double counted, const surprise *seen, int count);

/* At rest the unexplained torque is friction; more than friction can hold is contact. */
void contact_watch(payload_estimator *e, const estimator_row *row, const double *links, const double *payload);

#endif
