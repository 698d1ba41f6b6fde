/* The products of small matrices and vectors in which fatrop's factorisation and solves spend their time, four rows at
 * once.
 *
 * blasfeo keeps a matrix in panels of four rows, column after column. Its own functions are written for single numbers
 * in the library that casadi brings along. These hold four results in a vector. They add in the same order, and no
 * product is fused with a sum, so they have the same bits.
 */
#include "linear_algebra.h"

typedef double column __attribute__((vector_size(32), aligned(8), may_alias));

/* four of the numbers 0 to 3 of a and 4 to 7 of b */
#ifdef __clang__
#define PICKED(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
typedef long long order __attribute__((vector_size(32)));
#define PICKED(a, b, ...) __builtin_shuffle(a, b, (order){__VA_ARGS__})
#endif

INLINE column all(double number)
{
    return (column){number, number, number, number};
}

INLINE column at(const double *place)
{
    return *(const column *)place;
}

void gemm_nt(
    int kmax, const double *alpha, const double *A, const double *B, const double *beta, const double *C, double *D)
{
    column sums[4] = {all(0.0), all(0.0), all(0.0), all(0.0)};
    for (int k = 0; k < kmax; k++)
        UNROLL for (int j = 0; j < 4; j++) sums[j] += at(A + 4 * k) * all(B[4 * k + j]);
    UNROLL for (int j = 0; j < 4; j++) *(column *)(D + 4 * j) = all(*beta) * at(C + 4 * j) + all(*alpha) * sums[j];
}

INLINE void finish(const double *alpha, column sums, const double *beta, const double *y, double *z)
{
    sums *= all(*alpha);
    if (*beta != 0.0) sums += all(*beta) * at(y);
    *(column *)z = sums;
}

void gemv_n(
    int kmax, const double *alpha, const double *A, const double *x, const double *beta, const double *y, double *z)
{
    column sums = all(0.0);
    for (int k = 0; k < kmax; k++) sums += at(A + 4 * k) * all(x[k]);
    finish(alpha, sums, beta, y, z);
}

void gemv_t(
    int kmax, const double *alpha, int offset, const double *A, int width, const double *x, const double *beta,
    const double *y, double *z)
{
    column sums = all(0.0);
    int k = 0;
    if (offset != 0) {
        const int end = 4 - offset < kmax ? 4 - offset : kmax;
        for (; k < end; k++, A++) sums += (column){A[0], A[4], A[8], A[12]} * all(x[k]);
        A += 4 * (width - 1);
    }
    for (; k + 4 <= kmax; k += 4, A += 4 * width) {
        const column a = at(A), b = at(A + 4), c = at(A + 8), d = at(A + 12);
        const column even_ab = PICKED(a, b, 0, 4, 2, 6), odd_ab = PICKED(a, b, 1, 5, 3, 7);
        const column even_cd = PICKED(c, d, 0, 4, 2, 6), odd_cd = PICKED(c, d, 1, 5, 3, 7);
        sums += PICKED(even_ab, even_cd, 0, 1, 4, 5) * all(x[k]); /* a row of the panel */
        sums += PICKED(odd_ab, odd_cd, 0, 1, 4, 5) * all(x[k + 1]);
        sums += PICKED(even_ab, even_cd, 2, 3, 6, 7) * all(x[k + 2]);
        sums += PICKED(odd_ab, odd_cd, 2, 3, 6, 7) * all(x[k + 3]);
    }
    for (; k < kmax; k++, A++) sums += (column){A[0], A[4], A[8], A[12]} * all(x[k]);
    finish(alpha, sums, beta, y, z);
}
