/* The interpreter of elementary operations.
 *
 * Operations of one kind follow one another, in runs: the processor mispredicts only where a run ends.
 */
#include "interpreter.h"

#include <math.h>

#include "operations.h"

typedef void run_of_operations(const struct instruction *at, int count, real *number);

#define RUN_ON_VECTORS(operation, expression)                                                                         \
    static void run_##operation(const struct instruction *at, int count, real *number)                               \
    {                                                                                                                 \
        for (const struct instruction *end = at + count; at < end; at++) {                                            \
            const real x = number[at->a], y = number[at->b];                                                          \
            (void)y;                                                                                                  \
            number[at->to] = expression;                                                                              \
        }                                                                                                             \
    }
#define RUN_BY_LANE(operation, expression)                                                                            \
    static void run_##operation(const struct instruction *at, int count, real *number)                               \
    {                                                                                                                 \
        for (const struct instruction *end = at + count; at < end; at++)                                              \
            for (int lane = 0; lane < LANES; lane++) {                                                                \
                const double a = number[at->a][lane], b = number[at->b][lane];                                        \
                (void)b;                                                                                              \
                number[at->to][lane] = expression;                                                                    \
            }                                                                                                         \
    }
ON_VECTORS(RUN_ON_VECTORS)
BY_LANE(RUN_BY_LANE)

#define ENTRY(operation, expression) run_##operation,
static run_of_operations *const run[] = {ON_VECTORS(ENTRY) BY_LANE(ENTRY)};
enum { OPERATIONS = sizeof run / sizeof *run };

void interpret(const struct instruction *at, real *number)
{
    for (; at->to < OPERATIONS; at += 1 + at->a) run[at->to](at + 1, at->a, number);
}

void call(const struct function *function, const real *const given[ARGUMENTS], real *const found[RESULTS])
{
    real *number = function->number;
    for (int k = 0; k < ARGUMENTS; k++)
        if (given[k]) copy(given[k], function->argument_size[k], number + function->argument[k]);
    interpret(function->code, number);
    for (int k = 0; k < RESULTS; k++)
        if (found[k]) copy(number + function->result[k], function->result_size[k], found[k]);
}
