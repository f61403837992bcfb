/* Which batch kernels this processor can run. */

#include "batch.h"

const batch_kernels *const *batch_variants(void)
{
    static const batch_kernels *const every[] = {
#if defined(__x86_64__)
        &batch_avx2,
#endif
        &batch_baseline,
        NULL,
    };
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) {
        return every + 1;
    }
#endif
    return every;
}
