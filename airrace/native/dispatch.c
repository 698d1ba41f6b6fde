/* The choice of the variant at run time. */
#include <string.h>

#include "evaluator.h"
#include "operations.h"

extern const struct evaluator evaluator_baseline;

#ifdef X86_64
extern const struct evaluator evaluator_avx2, evaluator_avx512;
#endif

EXPORT const struct evaluator *airrace_evaluator(const char *name)
{
#ifdef X86_64
    __builtin_cpu_init();
    const int avx2 = __builtin_cpu_supports("avx2");
    const int avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                       __builtin_cpu_supports("avx512vl");
    if (avx512 && (!name || !strcmp(name, evaluator_avx512.name))) return &evaluator_avx512;
    if (avx2 && (!name || !strcmp(name, evaluator_avx2.name))) return &evaluator_avx2;
#endif
    return !name || !strcmp(name, evaluator_baseline.name) ? &evaluator_baseline : NULL;
}

#define OPERATION_NAME(operation, expression) " " #operation

EXPORT const char *airrace_operations(void)
{
    return ON_VECTORS(OPERATION_NAME) BY_LANE(OPERATION_NAME);
}
