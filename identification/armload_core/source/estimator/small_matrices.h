/* Factorisation and solution of small symmetric systems, of known sizes for the compiler to unroll. */

#ifndef ARMLOAD_SMALL_MATRICES_H
#define ARMLOAD_SMALL_MATRICES_H

#include <math.h>

#include "chain.h"
#include "payload_estimator.h"

/* Cholesky factor of a 10 x 10 matrix, in place. Returns 0 if it is not positive definite. */
static inline int factorised(double (*a)[BODY_PARAMETERS])
{
    for (int j = 0; j < BODY_PARAMETERS; j++) {
        double d = a[j][j];
        for (int k = 0; k < j; k++) {
            d -= a[j][k] * a[j][k];
        }
        if (!(d > 0.0)) {
            return 0;
        }
        const double root = sqrt(d);
        a[j][j] = root;
        for (int i = j + 1; i < BODY_PARAMETERS; i++) {
            double s = a[i][j];
            for (int k = 0; k < j; k++) {
                s -= a[i][k] * a[j][k];
            }
            a[i][j] = s / root;
        }
    }
    return 1;
}

/* x := L^-1 x, with a factor L from `factorised`. */
static inline void solve_lower(const double (*l)[BODY_PARAMETERS], double *x)
{
    for (int i = 0; i < BODY_PARAMETERS; i++) {
        for (int k = 0; k < i; k++) {
            x[i] -= l[i][k] * x[k];
        }
        x[i] /= l[i][i];
    }
}

/* x := L^-T x. */
static inline void solve_upper(const double (*l)[BODY_PARAMETERS], double *x)
{
    for (int i = BODY_PARAMETERS - 1; i >= 0; i--) {
        for (int k = i + 1; k < BODY_PARAMETERS; k++) {
            x[i] -= l[k][i] * x[k];
        }
        x[i] /= l[i][i];
    }
}

/* Inverse of a symmetric positive definite 3 x 3 matrix. */
static inline void inverted(const double (*a)[FRICTION_STATES], double (*inverse)[FRICTION_STATES])
{
    const double c00 = a[1][1] * a[2][2] - a[1][2] * a[1][2], c01 = a[0][2] * a[1][2] - a[0][1] * a[2][2];
    const double c02 = a[0][1] * a[1][2] - a[0][2] * a[1][1];
    const double scale = 1.0 / (a[0][0] * c00 + a[0][1] * c01 + a[0][2] * c02);
    inverse[0][0] = scale * c00;
    inverse[0][1] = inverse[1][0] = scale * c01;
    inverse[0][2] = inverse[2][0] = scale * c02;
    inverse[1][1] = scale * (a[0][0] * a[2][2] - a[0][2] * a[0][2]);
    inverse[1][2] = inverse[2][1] = scale * (a[0][1] * a[0][2] - a[0][0] * a[1][2]);
    inverse[2][2] = scale * (a[0][0] * a[1][1] - a[0][1] * a[0][1]);
}

#endif
