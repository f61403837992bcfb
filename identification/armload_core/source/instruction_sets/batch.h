/* Kernels over many samples. Each exists once per instruction set (`batch_*.c`); `batch_variants` lists them.

   Arrays are C-contiguous: states q, dq, ddq (samples, n) in rad, rad/s, rad/s2; n is 1 to MOST_JOINTS. */

#ifndef ARMLOAD_BATCH_H
#define ARMLOAD_BATCH_H

#include <stddef.h>
#include <stdint.h>

/* Numbers of a sphere, a half-space and a box, and where in them a part begins. */
enum { RADIUS = 3, SPHERE_NUMBERS };
enum { DISTANCE = 3, PLANE_NUMBERS };
enum { BOX_CENTRE = 9, BOX_HALVES = 12, BOX_NUMBERS = 15 };

/* Collision geometry: spheres around the links, and the half-spaces and boxes to keep clear of. A clearance is the
   distance of a sphere from a half-space, a box or another sphere, in this order. Link 0 is the base; link i moves with
   joint i. */
typedef struct {
    ptrdiff_t spheres;
    const int64_t *link;  /* (spheres) */
    const double *sphere; /* (spheres, SPHERE_NUMBERS) centre in the link's turned frame, radius */
    const double *plane;  /* (., PLANE_NUMBERS) unit normal towards the arm, distance from the origin along it */
    ptrdiff_t on_planes;
    const int64_t *on_plane; /* (on_planes, 2) sphere, plane */
    const double *box;       /* (., BOX_NUMBERS) axes as columns of a rotation (by rows), centre, half of the edges */
    ptrdiff_t on_boxes;
    const int64_t *on_box; /* (on_boxes, 2) sphere, box */
    ptrdiff_t pairs;
    const int64_t *pair; /* (pairs, 2) spheres */
} obstacles;

typedef struct {
    const char *name;

    /* Regressor of a body on the flange into out (samples, n, 10). */
    void (*payload_regressor)(const double *packed, int n, ptrdiff_t samples, const double *q, const double *dq,
                              const double *ddq, double *out);

    /* Regressors of all links side by side into zeroed out (samples, n, 10 n). */
    void (*body_regressor)(const double *packed, int n, ptrdiff_t samples, const double *q, const double *dq,
                           const double *ddq, double *out);

    /* Torque of links (n, 10), given in the turned joint frames, into out (samples, n). */
    void (*arm_torque)(const double *packed, int n, const double *links, ptrdiff_t samples, const double *q,
                       const double *dq, const double *ddq, double *out);

    /* Derivative of sum_t weight_t^T tau_t by q, dq, ddq into zeroed slope (3, samples, n). */
    void (*arm_torque_slope)(const double *packed, int n, const double *links, const double *weight, ptrdiff_t samples,
                             const double *q, const double *dq, const double *ddq, double *slope);

    /* Derivative of sum_ti Phi_ti^T body_ti by q, dq, ddq into slope (3, samples, n); bodies (samples, n, 10). */
    void (*regressor_slope)(const double *packed, int n, const double *bodies, ptrdiff_t samples, const double *q,
                            const double *dq, const double *ddq, double *slope);

    /* All clearances into out (samples, K). Returns 0, or -1 if memory for the spheres' centres cannot be allocated. */
    int (*clearances)(const double *packed, int n, const obstacles *around, ptrdiff_t samples, const double *q,
                      double *out);

    /* Derivative of the sum of weight (samples, K) times clearance by q into zeroed slope (samples, n). Returns like
       `clearances`. */
    int (*clearance_slope)(const double *packed, int n, const obstacles *around, const double *weight,
                           ptrdiff_t samples, const double *q, double *slope);

    /* Torque of a payload for one state; `model` is `packed` followed by the payload's ten parameters. */
    void (*payload_torque)(const double *model, int n, const double *q, const double *dq, const double *ddq,
                           double *torque);

    /* Sine and cosine as the kernels compute them. */
    void (*sine_cosine)(ptrdiff_t count, const double *angle, double *sine, double *cosine);
} batch_kernels;

extern const batch_kernels batch_baseline;
#if defined(__x86_64__)
extern const batch_kernels batch_avx2;
#endif

/* The variants that this processor can run, fastest first, terminated by NULL. */
const batch_kernels *const *batch_variants(void);

#endif
