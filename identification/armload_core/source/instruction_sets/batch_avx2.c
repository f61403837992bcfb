/* Four samples side by side, on x86-64 with AVX2 and fused multiply-add (Haswell of 2013 and later). */

#if defined(__x86_64__)

#define LANES 4
#define TARGET __attribute__((target("avx2,fma")))

#include "variant.h"

const batch_kernels batch_avx2 = ALL_KERNELS("avx2");

#else

typedef int empty_on_other_architectures;

#endif
