/* Front end: means over 10 ms, and from a window of them a row: position, its derivatives and torque, filtered alike. */

#ifndef ARMLOAD_SAMPLE_WINDOW_H
#define ARMLOAD_SAMPLE_WINDOW_H

#include "payload_estimator.h"

/* Forget all samples. */
void window_clear(payload_estimator *e);

/* Store the mean of the gathered samples in the window. */
void window_close_mean(payload_estimator *e);

/* Row at the middle of the window: acceleration from a least-squares cubic, the other signals filtered to match.
   Returns 0 if the window has too few samples. */
int window_row(const payload_estimator *e, estimator_row *row);

#endif
