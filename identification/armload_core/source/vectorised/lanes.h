/* Vectors of LANES samples, and their sine and cosine.

   A file that compiles the kernels for an instruction set (`batch_*.c`) first defines LANES, 2 or 4, and TARGET, the
   function attribute that selects the instruction set. Without these they are what every processor can do. */

#ifndef ARMLOAD_LANES_H
#define ARMLOAD_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifndef LANES
#define LANES 2
#define TARGET
#endif

/* A helper of the kernels, and a kernel. */
#define INLINE static inline __attribute__((always_inline)) TARGET
#define ENTRY static inline TARGET

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef double loose_lanes __attribute__((vector_size(8 * LANES), aligned(8), may_alias)); /* any array element */
typedef int64_t lane_bits __attribute__((vector_size(8 * LANES))); /* a comparison's result: 0 or -1 per lane */
typedef uint64_t lane_words __attribute__((vector_size(8 * LANES)));

INLINE lanes all(double value)
{
#if LANES == 2
    return (lanes){value, value};
#else
    return (lanes){value, value, value, value};
#endif
}

INLINE lane_bits bits_of(lanes v)
{
    return (lane_bits)v;
}

INLINE lanes chosen(lane_bits where, lanes yes, lanes no)
{
    return (lanes)((where & bits_of(yes)) | (~where & bits_of(no)));
}

INLINE lanes magnitude(lanes v)
{
    return (lanes)(bits_of(v) & INT64_MAX);
}

/* |size|, with the sign of `sign`. */
INLINE lanes with_sign(lanes size, lanes sign)
{
    return (lanes)((bits_of(size) & INT64_MAX) | (bits_of(sign) & INT64_MIN));
}

INLINE lanes square_root(lanes v)
{
    for (int l = 0; l < LANES; l++) {
        v[l] = sqrt(v[l]);
    }
    return v;
}

INLINE int any(lane_bits where)
{
    int64_t found = 0;
    for (int l = 0; l < LANES; l++) {
        found |= where[l];
    }
    return found != 0;
}

INLINE double total(lanes v)
{
    double sum = 0.0;
    for (int l = 0; l < LANES; l++) {
        sum += v[l];
    }
    return sum;
}

/* Indices of LANES samples. The last group of a batch may have fewer: its spare lanes repeat the last sample. */
typedef struct {
    ptrdiff_t sample[LANES];
    int used;
} group;

INLINE group group_at(ptrdiff_t first, ptrdiff_t samples)
{
    group g;
    g.used = samples - first < LANES ? (int)(samples - first) : LANES;
    for (int l = 0; l < LANES; l++) {
        g.sample[l] = first + (l < g.used ? l : g.used - 1);
    }
    return g;
}

/* One column of an array (samples, width) at the group's samples. */
INLINE lanes gathered(const group *g, const double *array, ptrdiff_t width, ptrdiff_t column)
{
    lanes v;
    for (int l = 0; l < LANES; l++) {
        v[l] = array[g->sample[l] * width + column];
    }
    return v;
}

#if defined(__clang__) || __GNUC__ >= 12
#define SHUFFLED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLED(a, b, ...) __builtin_shuffle(a, b, (lane_bits){__VA_ARGS__})
#endif

/* Store LANES consecutive values per sample: values[k][l] to rows[l][k]. */
INLINE void store_transposed(const lanes *values, double *const *rows)
{
#if LANES == 2
    *(loose_lanes *)rows[0] = SHUFFLED(values[0], values[1], 0, 2);
    *(loose_lanes *)rows[1] = SHUFFLED(values[0], values[1], 1, 3);
#else
    const lanes even01 = SHUFFLED(values[0], values[1], 0, 4, 2, 6), odd01 = SHUFFLED(values[0], values[1], 1, 5, 3, 7);
    const lanes even23 = SHUFFLED(values[2], values[3], 0, 4, 2, 6), odd23 = SHUFFLED(values[2], values[3], 1, 5, 3, 7);
    *(loose_lanes *)rows[0] = SHUFFLED(even01, even23, 0, 1, 4, 5);
    *(loose_lanes *)rows[1] = SHUFFLED(odd01, odd23, 0, 1, 4, 5);
    *(loose_lanes *)rows[2] = SHUFFLED(even01, even23, 2, 3, 6, 7);
    *(loose_lanes *)rows[3] = SHUFFLED(odd01, odd23, 2, 3, 6, 7);
#endif
}

/* Store `count` values per sample into the group's rows of an array (samples, width), from `column` on. */
INLINE void scattered(const group *g, const lanes *values, int count, double *array, ptrdiff_t width, ptrdiff_t column)
{
    double *rows[LANES];
    int k = 0;
    for (int l = 0; l < LANES; l++) {
        rows[l] = array + g->sample[l] * width + column;
    }
    for (; g->used == LANES && k + LANES <= count; k += LANES) {
        store_transposed(values + k, rows);
        for (int l = 0; l < LANES; l++) {
            rows[l] += LANES;
        }
    }
    for (; k < count; k++) {
        for (int l = 0; l < g->used; l++) {
            *rows[l]++ = values[k][l];
        }
    }
}

/* Sine and cosine, within 2e-16 of the true value (tested against libm: 4e-16).

   A multiple of pi/2 is subtracted in three parts, the first two of 33 bits, so that their products with up to 2^20 are
   exact; then minimax polynomials over a quadrant (Remez; greatest errors 3.5e-18 and 4.7e-20). Angles beyond 2^20
   quadrants and non-finite ones are computed by libm. */
static const double GREATEST_REDUCED_RAD = 1.6e6;
static const double QUADRANTS_PER_RAD = 0x1.45f306dc9c883p-1; /* 2/pi */
static const double QUADRANT_1_RAD = 0x1.921fb544p+0, QUADRANT_2_RAD = 0x1.0b4611a6p-34; /* the parts of pi/2 */
static const double QUADRANT_3_RAD = 0x1.3198a2e037073p-69;
static const double ROUNDER = 0x1.8p52; /* x + ROUNDER has x, rounded to an integer, in its low bits; |x| < 2^51 */

INLINE void sine_cosine(lanes x, lanes *sine, lanes *cosine)
{
    const lanes shifted = x * QUADRANTS_PER_RAD + ROUNDER;
    const lanes turns = shifted - ROUNDER;
    const lane_words quadrant = (lane_words)shifted;
    const lanes r = ((x - turns * QUADRANT_1_RAD) - turns * QUADRANT_2_RAD) - turns * QUADRANT_3_RAD;
    const lanes z = r * r;
    /* clang-format off */
    const lanes s =
        r + r * z * (-0x1.5555555555549p-3 + z * (0x1.111111110f861p-7 + z * (-0x1.a01a019c0e4c4p-13
          + z * (0x1.71de3574ba7f9p-19 + z * (-0x1.ae5e63cda0443p-26 + z * 0x1.5d9246d3d72dep-33)))));
    const lanes c =
        1.0 - 0.5 * z + z * z * (0x1.555555555554cp-5 + z * (-0x1.6c16c16c15162p-10 + z * (0x1.a01a019caef38p-16
          + z * (-0x1.27e4f807d633ap-22 + z * (0x1.1ee9ea6cd0c98p-29 + z * -0x1.8fadd078db743p-37)))));
    /* clang-format on */
    const lane_bits odd = (lane_bits)(0 - (quadrant & 1));
    *sine = (lanes)((lane_words)chosen(odd, c, s) ^ ((quadrant & 2) << 62));
    *cosine = (lanes)((lane_words)chosen(odd, s, c) ^ (((quadrant + 1) & 2) << 62));
    if (any(~(magnitude(x) <= GREATEST_REDUCED_RAD))) {
        for (int l = 0; l < LANES; l++) {
            if (!(fabs(x[l]) <= GREATEST_REDUCED_RAD)) {
                (*sine)[l] = sin(x[l]);
                (*cosine)[l] = cos(x[l]);
            }
        }
    }
}

#endif
