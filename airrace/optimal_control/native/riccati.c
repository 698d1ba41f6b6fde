/* The Newton step of a program of stages, by a Riccati recursion.
 *
 *     H_k z_k - F_k' y_k + (y_{k-1}; 0) = r_k        z_k = (x_k; u_k), k = 0 ... N, no y_{-1} and no y_N
 *     x_{k+1} - F_k z_k = s_k
 *
 * The matrices of all stages lie one behind the other: H of n x n and F of m x n numbers column by column, with m states
 * and n = m + u unknowns; C row by row, its rows (constraints of the stage) weighed and added to H: H + C' diag(w) C.
 * Sums are added in an order that does not depend on the processor, and no product is fused with a sum.
 */

#include "riccati.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* products and factors of the small dense matrices of a stage */

enum { MOST = 64 }; /* unknowns of a stage; MOST_UNKNOWNS in assembly.py */

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

/* the recursion */

/* Factorise; the factors of stage k are kept in its part of `factors`: M (n x n), with P in the place of the states,
 * L of the controls below it, and W = L^-1 M_ux; then the states' factor of stage 0 in `first`.
 * Returns how many pivots are not positive: 0 where the step leads to a minimum. */
int riccati_factorise(int stages, int m, const int *sizes, const double *H, const double *F, const int *rows,
                      const double *C, const double *row_weights, const double *weights, double *factors, double *first)
{
    int64_t h = 0, c = 0, r = 0, z = 0;
    int wrong = 0;
    for (int k = 0; k < stages; k++) {
        h += (int64_t)sizes[k] * sizes[k];
        c += (int64_t)rows[k] * sizes[k];
        r += rows[k];
        z += sizes[k];
    }
    const double *after = 0;
    int64_t f = (z - sizes[stages - 1]) * m;
    for (int k = stages - 1; k >= 0; k--) {
        const int n = sizes[k], u = n - m;
        h -= (int64_t)n * n, c -= (int64_t)rows[k] * n, r -= rows[k], z -= n;
        double *M = factors + h;
        memcpy(M, H + h, sizeof(double) * n * n);
        for (int row = 0; row < rows[k]; row++) {
            const double *of = C + c + (int64_t)row * n;
            for (int j = 0; j < n; j++)
                if (of[j] != 0.0) add(n, row_weights[r + row] * of[j], of, M + j * n);
        }
        for (int j = 0; j < n; j++) M[j * n + j] += weights[z + j];
        if (after) {
            f -= (int64_t)m * n;
            double transposed[MOST * MOST], product[MOST];
            for (int j = 0; j < n; j++)
                for (int i = 0; i < m; i++) transposed[i * n + j] = F[f + j * m + i];
            const int width = sizes[k + 1];
            for (int j = 0; j < n; j++) {
                memset(product, 0, sizeof product);
                for (int i = 0; i < m; i++) add(m, F[f + j * m + i], after + i * width, product);
                for (int i = 0; i < m; i++) add(n, product[i], transposed + i * n, M + j * n);
            }
        }
        wrong += cholesky(u, n, M + m * n + m);
        for (int j = 0; j < m; j++) solve_lower(u, n, M + m * n + m, M + j * n + m);
        double W[MOST * MOST];
        for (int i = 0; i < u; i++)
            for (int j = 0; j < m; j++) W[i * m + j] = M[j * n + m + i];
        for (int j = 0; j < m; j++)
            for (int i = 0; i < u; i++) add(m, -W[i * m + j], W + i * m, M + j * n);
        for (int j = 0; j < m; j++)
            for (int i = 0; i < j; i++) M[j * n + i] = M[i * n + j] = 0.5 * (M[j * n + i] + M[i * n + j]);
        after = M;
    }
    for (int j = 0; j < m; j++) memcpy(first + j * m, factors + j * sizes[0], sizeof(double) * m);
    return wrong + cholesky(m, m, first);
}

/* Solve with the factors; `feedforward` has room for all unknowns, `cost_gradients` for the states of all stages. */
void riccati_solve(int stages, int m, const int *sizes, const double *F, const double *factors, const double *first,
                   const double *r, const double *s, double *feedforward, double *cost_gradients, double *step,
                   double *y)
{
    int64_t h = 0, z = 0;
    for (int k = 0; k < stages; k++) h += (int64_t)sizes[k] * sizes[k], z += sizes[k];
    int64_t f = (z - sizes[stages - 1]) * m;
    for (int k = stages - 1; k >= 0; k--) {
        const int n = sizes[k], u = n - m;
        double *q = feedforward + (z -= n), ahead[MOST];
        memcpy(q, r + z, sizeof(double) * n);
        if (k < stages - 1) {
            const double *P = factors + h, *gap = s + (int64_t)k * m;
            const int width = sizes[k + 1];
            memcpy(ahead, cost_gradients + (int64_t)(k + 1) * m, sizeof(double) * m);
            for (int j = 0; j < m; j++) add(m, -gap[j], P + j * width, ahead);
            f -= (int64_t)m * n;
            for (int j = 0; j < n; j++) q[j] += dot(m, F + f + j * m, ahead);
        }
        h -= (int64_t)n * n;
        const double *M = factors + h;
        solve_lower(u, n, M + m * n + m, q + m);
        for (int j = 0; j < m; j++) cost_gradients[(int64_t)k * m + j] = q[j] - dot(u, M + j * n + m, q + m);
    }
    memcpy(step, cost_gradients, sizeof(double) * m);
    solve_lower(m, m, first, step);
    solve_upper(m, m, first, step);
    for (int k = 0; k < stages; k++) {
        const int n = sizes[k], u = n - m;
        const double *M = factors + h;
        double *x = step + z, *to = x + m;
        if (k > 0) {
            double *multiplier = y + (int64_t)(k - 1) * m;
            memcpy(multiplier, cost_gradients + (int64_t)k * m, sizeof(double) * m);
            for (int j = 0; j < m; j++) add(m, -x[j], M + j * n, multiplier);
        }
        memcpy(to, feedforward + z + m, sizeof(double) * u);
        for (int j = 0; j < m; j++) add(u, -x[j], M + j * n + m, to);
        solve_upper(u, n, M + m * n + m, to);
        if (k < stages - 1) {
            double *next = step + z + n;
            memcpy(next, s + (int64_t)k * m, sizeof(double) * m);
            for (int j = 0; j < n; j++) add(m, x[j], F + f + j * m, next);
            f += (int64_t)m * n;
        }
        h += (int64_t)n * n, z += n;
    }
}

/* values = C z */
void riccati_rows(int stages, const int *sizes, const int *rows, const double *C, const double *z, double *values)
{
    for (int k = 0; k < stages; z += sizes[k++])
        for (int row = 0; row < rows[k]; row++, C += sizes[k]) *values++ = dot(sizes[k], C, z);
}

/* z += C' values */
void riccati_rows_transposed(int stages, const int *sizes, const int *rows, const double *C, const double *values, double *z)
{
    for (int k = 0; k < stages; z += sizes[k++])
        for (int row = 0; row < rows[k]; row++, C += sizes[k]) add(sizes[k], *values++, C, z);
}
