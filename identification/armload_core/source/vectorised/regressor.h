/* Regressors of many samples. */

#ifndef ARMLOAD_REGRESSOR_H
#define ARMLOAD_REGRESSOR_H

#include <stddef.h>

#include "body_columns.h"
#include "chain.h"
#include "frames.h"
#include "lanes.h"

ENTRY void payload_regressor(const double *packed, int n, ptrdiff_t samples, const double *q, const double *dq,
                             const double *ddq, double *out)
{
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        motion m;
        lanes rows[MOST_JOINTS][BODY_PARAMETERS];
        gather_motion(&g, n, n, q, dq, ddq, &m);
        forward_pass(packed, n, &m, frames);
        flange_columns(packed, n, frames, rows);
        scattered(&g, rows[0], BODY_PARAMETERS * n, out, BODY_PARAMETERS * n, 0);
    }
}

ENTRY void body_regressor(const double *packed, int n, ptrdiff_t samples, const double *q, const double *dq,
                          const double *ddq, double *out)
{
    const ptrdiff_t width = BODY_PARAMETERS * n;
    for (ptrdiff_t t = 0; t < samples; t += LANES) {
        const group g = group_at(t, samples);
        frame frames[MOST_JOINTS];
        motion m;
        lanes rows[MOST_JOINTS][BODY_PARAMETERS];
        gather_motion(&g, n, n, q, dq, ddq, &m);
        forward_pass(packed, n, &m, frames);
        for (int link = 1; link <= n; link++) {
            body_columns(frames, link, turned_of(packed, n, link - 1), NULL, rows);
            for (int i = 0; i < link; i++) {
                scattered(&g, rows[i], BODY_PARAMETERS, out, n * width, i * width + BODY_PARAMETERS * (link - 1));
            }
        }
    }
}

#endif
