/* Two samples side by side, on every processor of an architecture: SSE2 on x86-64, NEON on aarch64. */

#define LANES 2
#define TARGET
#define VARIANT batch_baseline
#define NAME "baseline"

#include "variant.h"
