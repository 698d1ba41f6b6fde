/* Several intervals at once: a `real` holds one number of each of LANES intervals.
 *
 * Each variant of the library compiles the files that include this one for its instruction set (VARIANT, LANES).
 * Arithmetic is lane by lane; functions of the C library are called for one lane after the other; no product is fused
 * with a sum (-ffp-contract=off). A lane has the bits that a single number would have, in every variant.
 */
#ifndef AIRRACE_LANES_H
#define AIRRACE_LANES_H

#define JOIN_NAMES(name, variant) name##_##variant
#define NAME_IN(name, variant) JOIN_NAMES(name, variant)
#define VARIANT_NAME(name) NAME_IN(name, VARIANT) /* the name of a function that every variant has */

#define INLINE static inline __attribute__((always_inline))

#if defined(__clang__)
#define UNROLL _Pragma("clang loop unroll(full)")
#else
#define UNROLL _Pragma("GCC unroll 8") /* a short loop, whose sums then stay in registers */
#endif

typedef double real __attribute__((vector_size(8 * LANES)));

/* the same number in every lane; a difference, for -0.0 + 0.0 would be 0.0 */
INLINE real broadcast(double number)
{
    return number - (real){0.0};
}

INLINE void copy(const real *from, int size, real *to)
{
    for (int i = 0; i < size; i++) to[i] = from[i];
}

INLINE void fill(real *to, int size, double number)
{
    const real all = broadcast(number);
    for (int i = 0; i < size; i++) to[i] = all;
}

#endif
