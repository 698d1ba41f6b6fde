/* The functions that the library has once: the choice of the variant at run time, and sums. */
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

/* Sums of weighted numbers, added in one order whatever evaluates them, see sparse_assembly.py. Both functions return
 * whether all are finite. */

/* Sum i adds up weights[k] * drawn[sources[k]] for k from begins[i] to begins[i + 1], at least one, in this order, and
 * goes to memory[places[i]]. */
EXPORT int airrace_add_up(int64_t count, const int32_t *begins, const double *weights, const int32_t *sources, const double *drawn,
           const int64_t *places, double *memory)
{
    int finite = 1;
    for (int64_t i = 0; i < count; i++) {
        int32_t k = begins[i];
        double sum = weights[k] * drawn[sources[k]];
        for (k++; k < begins[i + 1]; k++) sum += weights[k] * drawn[sources[k]];
        memory[places[i]] = sum;
        finite &= sum - sum == 0.0;
    }
    return finite;
}

/* Sums that repeat from stage to stage. A stage of kind j has the sums from first[j] to first[j + 1]; numbers of block b
 * begin at at[b], its matrices of family f at to[f]. */
EXPORT int airrace_add_up_repeated(int64_t stages, int64_t blocks, int64_t families, const int32_t *kind, const int32_t *first,
                    const int32_t *begins, const double *weights, const int32_t *sources, const int32_t *block,
                    const int32_t *family, const int32_t *offsets, const int64_t *at, const int64_t *to,
                    const double *drawn, double *memory)
{
    int finite = 1;
    for (int64_t stage = 0; stage < stages; stage++, at += blocks, to += families) {
        for (int32_t i = first[kind[stage]]; i < first[kind[stage] + 1]; i++) {
            int32_t k = begins[i];
            double sum = weights[k] * drawn[at[block[k]] + sources[k]];
            for (k++; k < begins[i + 1]; k++) sum += weights[k] * drawn[at[block[k]] + sources[k]];
            memory[to[family[i]] + offsets[i]] = sum;
            finite &= sum - sum == 0.0;
        }
    }
    return finite;
}
