/* Torque of a payload for one state: the feed-forward's kernel. */

#ifndef ARMLOAD_PAYLOAD_TORQUE_H
#define ARMLOAD_PAYLOAD_TORQUE_H

/* `model` is an arm's packed array with a payload's ten parameters; q, dq, ddq and torque have n numbers. */
void payload_torque(const double *model, int n, const double *q, const double *dq, const double *ddq, double *torque);

#endif
