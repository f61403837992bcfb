/* Four samples side by side, on x86-64 with AVX2 and fused multiply-add (Haswell of 2013 and later). */

#if defined(__x86_64__)

#define LANES 4
#define TARGET __attribute__((target("avx2,fma")))
#define VARIANT batch_avx2
#define NAME "avx2"

#include "variant.h"

#else

typedef int empty_on_other_architectures;

#endif
