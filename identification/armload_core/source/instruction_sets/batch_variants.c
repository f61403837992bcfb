/* Selection of the kernels that this processor can run. */

#include "batch.h"

#if defined(__x86_64__)
#include <cpuid.h>

/* Uses CPUID directly: compiled with zig, __builtin_cpu_supports always returns 0. */
static int has_avx2_and_fma(void)
{
    const unsigned fma = 1u << 12, saved_by_the_system = 1u << 27, avx2 = 1u << 5, vector_registers = 6u;
    unsigned a, b, c, d, saved, unused;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & fma) || !(c & saved_by_the_system)) {
        return 0;
    }
    __asm__("xgetbv" : "=a"(saved), "=d"(unused) : "c"(0));
    return (saved & vector_registers) == vector_registers && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & avx2) != 0;
}
#endif

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
    /* Asked once: in a virtual machine CPUID leaves the guest, which takes 10 us each time. */
    static int found = -1;
    if (found < 0) {
        found = has_avx2_and_fma();
    }
    if (!found) {
        return every + 1;
    }
#endif
    return every;
}
