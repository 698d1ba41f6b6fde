/* Products and factors of the small dense matrices of a stage.
 *
 * Sums are added in an order that does not depend on the processor, and no product is fused with a sum.
 */
#ifndef AIRRACE_DENSE_H
#define AIRRACE_DENSE_H

#include <math.h>

enum { MOST = 64 }; /* unknowns of a stage; MOST_UNKNOWNS in stage_matrices.py */

typedef double column __attribute__((vector_size(32), aligned(8), may_alias));

static inline double dot(int n, const double *a, const double *b)
{
    column sums = {0.0, 0.0, 0.0, 0.0};
    int i = 0;
    for (; i + 4 <= n; i += 4) sums += *(const column *)(a + i) * *(const column *)(b + i);
    double sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    for (; i < n; i++) sum += a[i] * b[i];
    return sum;
}

static inline void add(int n, double factor, const double *a, double *restrict to)
{
    int i = 0;
    for (; i + 4 <= n; i += 4) *(column *)(to + i) += factor * *(const column *)(a + i);
    for (; i < n; i++) to[i] += factor * a[i];
}

/* the lower triangle of A = L L' in the place of A, column by column; returns how many pivots are not positive */
static inline int cholesky(int n, int width, double *A)
{
    int wrong = 0;
    for (int j = 0; j < n; j++) {
        double *column_j = A + j * width;
        for (int m = 0; m < j; m++) add(n - j, -A[m * width + j], A + m * width + j, column_j + j);
        if (!(column_j[j] > 0.0)) {
            wrong++;
            column_j[j] = HUGE_VAL;
        }
        const double root = sqrt(column_j[j]);
        for (int i = j; i < n; i++) column_j[i] = i == j ? root : column_j[i] / root;
    }
    return wrong;
}

static inline void solve_lower(int n, int width, const double *L, double *b)
{
    for (int j = 0; j < n; j++) {
        b[j] /= L[j * width + j];
        add(n - j - 1, -b[j], L + j * width + j + 1, b + j + 1);
    }
}

static inline void solve_upper(int n, int width, const double *L, double *b)
{
    for (int j = n - 1; j >= 0; j--) b[j] = (b[j] - dot(n - j - 1, L + j * width + j + 1, b + j + 1)) / L[j * width + j];
}

#endif
