/* Two samples side by side, on every processor of an architecture: SSE2 on x86-64, NEON on aarch64. */

#define LANES 2
#define TARGET

#include "variant.h"

const batch_kernels batch_baseline = ALL_KERNELS("baseline");
