/* Several intervals at once: a `real` is one number of each of LANES intervals, one lane per interval.
 *
 * Arithmetic is the compiler's on vectors, lane by lane as on single numbers. Everything else is a loop over the lanes
 * that calls what the C library has for one number. No product is fused with a sum (-ffp-contract=off). So a lane holds
 * the bits that a single number would, whatever the other lanes hold and however many there are.
 */

#include <math.h>

typedef double real __attribute__((vector_size(8 * LANES)));
typedef long long int integer;

#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))

/* the same number in every lane */
INLINE real all(double number)
{
    real x;
    for (int lane = 0; lane < LANES; lane++) x[lane] = number;
    return x;
}

#define LANE_BY_LANE(name, expression)                                                                                \
    INLINE real name##_of_lanes(real x, real y)                                                                       \
    {                                                                                                                 \
        real z;                                                                                                       \
        for (int lane = 0; lane < LANES; lane++) {                                                                    \
            const double a = x[lane], b = y[lane];                                                                    \
            (void)b;                                                                                                  \
            z[lane] = expression;                                                                                     \
        }                                                                                                             \
        return z;                                                                                                     \
    }
