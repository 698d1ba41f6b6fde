/* Sums of weighted numbers that lie anywhere, written to any places.
 *
 * Sum i adds up weights[k] * drawn[sources[k]] for k from begins[i] to begins[i + 1], at least one, in this order, and
 * goes to memory[places[i]]. The result is 1 if all sums are finite, else 0.
 */

#include <stdint.h>

int add_up(int64_t count, const int32_t *begins, const double *weights, const int32_t *sources, const double *drawn,
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
