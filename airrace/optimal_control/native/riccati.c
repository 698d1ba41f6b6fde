/* The Newton step of a program of stages, by a Riccati recursion, and the curvature on the null space of its rows.
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

/* Whether a quadratic form has more curvature than a number on the directions that keep gaps and rows: a Riccati
 * recursion on their null space, which second_order.py describes.
 *
 * Rows become orthogonal by Jacobi's one-sided rotations [Golub & Van Loan 2013, 8.6.3], which leave their singular
 * values as lengths. */

enum { MOST_ROWS = 2 * MOST, SWEEPS = 40 };

static const double RANK = 1e-6;          /* as in second_order.py */
static const double ORTHOGONAL = 1e-14;   /* the cosine of rows that count as orthogonal */
static const double NEGLIGIBLE = 1e-24;   /* a product of lengths far below RANK */
static const double STIFF = 1e6;          /* as in second_order.py */

/* rotate rows into one another until their entries from `first` on are orthogonal */
static void orthogonalise(int rows, int width, int first, double *D)
{
    const int n = width - first;
    for (int sweep = 0, rotated = 1; rotated && sweep < SWEEPS; sweep++) {
        rotated = 0;
        for (int p = 0; p < rows - 1; p++)
            for (int q = p + 1; q < rows; q++) {
                double *row_p = D + p * width, *row_q = D + q * width;
                const double product = dot(n, row_p + first, row_q + first);
                const double a = dot(n, row_p + first, row_p + first), b = dot(n, row_q + first, row_q + first);
                if (!(fabs(product) > ORTHOGONAL * sqrt(a * b) + NEGLIGIBLE)) continue;
                const double zeta = (b - a) / (2.0 * product);
                const double tangent = (zeta < 0.0 ? -1.0 : 1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                const double cosine = 1.0 / sqrt(1.0 + tangent * tangent), sine = cosine * tangent;
                for (int i = 0; i < width; i++) {
                    const double before = row_p[i];
                    row_p[i] = cosine * before - sine * row_q[i];
                    row_q[i] = sine * before + cosine * row_q[i];
                }
                rotated = 1;
            }
    }
}

/* give rows the length 1 and leave out those that are no longer than RANK; returns how many are left */
static int normalise(int rows, int width, double *D)
{
    int left = 0;
    for (int row = 0; row < rows; row++) {
        const double length = sqrt(dot(width, D + row * width, D + row * width));
        if (!(length > RANK)) continue;
        for (int i = 0; i < width; i++) D[left * width + i] = D[row * width + i] / length;
        left++;
    }
    return left;
}

/* complete `rank` orthonormal vectors of n numbers to a basis */
static void complete(int rank, int n, double *basis)
{
    double rest[MOST];
    for (int j = 0; j < n; j++) {
        rest[j] = 1.0;
        for (int i = 0; i < rank; i++) rest[j] -= basis[i * n + j] * basis[i * n + j];
    }
    for (int next = rank; next < n; next++) {
        double *vector = basis + next * n;
        int most = 0;
        for (int j = 1; j < n; j++)
            if (rest[j] > rest[most]) most = j;
        memset(vector, 0, sizeof(double) * n);
        vector[most] = 1.0;
        for (int turn = 0; turn < 2; turn++)
            for (int i = 0; i < next; i++) add(n, -dot(n, basis + i * n, vector), basis + i * n, vector);
        const double length = sqrt(dot(n, vector, vector));
        for (int j = 0; j < n; j++) {
            vector[j] /= length;
            rest[j] -= vector[j] * vector[j];
        }
    }
}

/* the unknowns of a stage that are not held */
struct unknowns {
    int n, m, free_controls; /* unknowns, states, controls that are free */
    int control[MOST];       /* the places of these */
    const unsigned char *held;
};

static struct unknowns read_unknowns(int n, int m, const unsigned char *held)
{
    struct unknowns of = {.n = n, .m = m, .held = held};
    for (int i = m; i < n; i++)
        if (!held[i]) of.control[of.free_controls++] = i;
    return of;
}

/* (states, free controls) of a row of all unknowns */
static void gather(const struct unknowns *of, const double *row, double *to)
{
    for (int i = 0; i < of->m; i++) to[i] = of->held[i] ? 0.0 : row[i];
    for (int i = 0; i < of->free_controls; i++) to[of->m + i] = row[of->control[i]];
}

/* Solve `rows` for the free controls: u = G (x, v), v free. What binds x alone is added to `ahead`.
 * G has free_controls rows of m + *free numbers; returns the number of rows that are solved. */
static int eliminate(const struct unknowns *of, int rows, double *D, double *G, int *free, double *ahead, int *pending)
{
    const int m = of->m, u = of->free_controls, width = m + u;
    double basis[MOST * MOST];
    int rank = 0;
    rows = normalise(rows, width, D);
    if (rows > 1) {
        orthogonalise(rows, width, 0, D);
        rows = normalise(rows, width, D);
    }
    orthogonalise(rows, width, m, D);
    for (int row = 0; row < rows; row++) {
        const double *of_row = D + row * width, length = sqrt(dot(u, of_row + m, of_row + m));
        if (length > RANK && rank < u) {
            for (int i = 0; i < u; i++) basis[rank * u + i] = of_row[m + i] / length;
            for (int j = 0; j < m; j++) D[rank * width + j] = of_row[j] / length; /* rank <= row: read before */
            rank++;
        } else {
            memcpy(ahead + (*pending)++ * m, of_row, sizeof(double) * m);
        }
    }
    complete(rank, u, basis);
    *free = u - rank;
    for (int i = 0; i < u; i++) {
        double *to = G + i * (m + *free);
        memset(to, 0, sizeof(double) * m);
        for (int row = 0; row < rank; row++) add(m, -basis[row * u + i], D + row * width, to);
        for (int j = 0; j < *free; j++) to[m + j] = basis[(rank + j) * u + i];
    }
    return rank;
}

/* M of (x, v) for that of all unknowns, both column by column */
static void reduce(const struct unknowns *of, int free, const double *G, const double *whole, double *M)
{
    const int n = of->n, m = of->m, width = m + free;
    for (int j = 0; j < width; j++) {
        double column[MOST] = {0.0};
        if (j < m && !of->held[j]) memcpy(column, whole + j * n, sizeof(double) * n);
        for (int i = 0; i < of->free_controls; i++)
            if (G[i * width + j] != 0.0) add(n, G[i * width + j], whole + of->control[i] * n, column);
        double *to = M + j * width;
        for (int i = 0; i < m; i++) to[i] = of->held[i] ? 0.0 : column[i];
        memset(to + m, 0, sizeof(double) * free);
        for (int i = 0; i < of->free_controls; i++)
            if (column[of->control[i]] != 0.0) add(width, column[of->control[i]], G + i * width, to);
    }
}

/* Take the squares of changes of the states off the costs as long as one costs more than STIFF, and let these changes
 * be zero, as rows that are handed on. */
static void hold_stiff(int m, double *costs, double *ahead, int *pending)
{
    for (int turn = 0; turn < m; turn++) {
        int most = 0;
        for (int i = 1; i < m; i++)
            if (costs[i * m + i] > costs[most * m + most]) most = i;
        const double largest = costs[most * m + most];
        if (!(largest > STIFF)) return;
        double change[MOST];
        for (int i = 0; i < m; i++) change[i] = costs[most * m + i] / sqrt(largest);
        for (int i = 0; i < m; i++) add(m, -change[i], change, costs + i * m);
        const double length = sqrt(dot(m, change, change));
        for (int i = 0; i < m; i++) ahead[*pending * m + i] = change[i] / length;
        (*pending)++;
    }
}

/* Go from the last stage to the first, with the curvature `shift` taken off everywhere.
 *
 * `kept` tells which rows and unknowns are zero (rows of all stages, then all unknowns). Stage k has its part of `gains`,
 * of n x n numbers: there its gain from x to z is written, n rows of m numbers. Where a stage has a direction of its
 * free controls with no more curvature, k is returned, `costs` are the `*free` x `*free` numbers of these, and its part
 * of `gains` leads from them to z. Else -1 is returned, `costs` are those of the first states (m x m), of which
 * `*free` rows of m numbers in `ahead` have to be zero. */
int null_space_riccati(int stages, int m, const int *sizes, const double *H, const double *F, const int *rows,
                       const double *C, const unsigned char *kept, const double *weights, double shift, double *gains,
                       double *costs, double *ahead, int *free)
{
    int64_t h = 0, c = 0, r = 0, z = 0;
    for (int k = 0; k < stages; k++) {
        h += (int64_t)sizes[k] * sizes[k];
        c += (int64_t)rows[k] * sizes[k];
        r += rows[k];
        z += sizes[k];
    }
    const unsigned char *held = kept + r;
    int64_t f = (z - sizes[stages - 1]) * m;
    int pending = 0;
    memset(costs, 0, sizeof(double) * m * m);
    for (int k = stages - 1; k >= 0; k--) {
        const int n = sizes[k], last = k == stages - 1;
        h -= (int64_t)n * n, c -= (int64_t)rows[k] * n, r -= rows[k], z -= n;
        if (!last) f -= (int64_t)m * n;
        const struct unknowns of = read_unknowns(n, m, held + z);
        const double *ends = F + f;
        double D[MOST_ROWS * MOST], G[MOST * MOST], whole[MOST * MOST], M[MOST * MOST], L[MOST * MOST];
        int chosen = 0;
        for (int row = 0; row < rows[k]; row++)
            if (kept[r + row]) gather(&of, C + c + (int64_t)row * n, D + chosen++ * (m + of.free_controls));
        for (int row = 0; row < pending; row++) {
            double before[MOST];
            for (int j = 0; j < n; j++) before[j] = last ? 0.0 : dot(m, ends + j * m, ahead + row * m);
            gather(&of, before, D + chosen++ * (m + of.free_controls));
        }
        pending = 0;
        for (int i = 0; i < m; i++)
            if (of.held[i]) {
                memset(ahead + pending * m, 0, sizeof(double) * m);
                ahead[pending++ * m + i] = 1.0;
            }
        eliminate(&of, chosen, D, G, free, ahead, &pending);

        const int v = *free, width = m + v;
        memcpy(whole, H + h, sizeof(double) * n * n);
        for (int j = 0; j < n; j++) {
            whole[j * n + j] -= shift * weights[k];
            if (last) continue;
            double product[MOST] = {0.0};
            for (int i = 0; i < m; i++) add(m, ends[j * m + i], costs + i * m, product);
            for (int i = j; i < n; i++) whole[j * n + i] += dot(m, ends + i * m, product);
            for (int i = j + 1; i < n; i++) whole[i * n + j] = whole[j * n + i];
        }
        reduce(&of, v, G, whole, M);
        for (int j = 0; j < v; j++) memcpy(L + j * v, M + (m + j) * width + m, sizeof(double) * v);
        double *gain = gains + h;
        memset(gain, 0, sizeof(double) * n * n);
        if (cholesky(v, v, L)) {
            for (int j = 0; j < v; j++) memcpy(costs + j * v, M + (m + j) * width + m, sizeof(double) * v);
            for (int i = 0; i < of.free_controls; i++)
                memcpy(gain + of.control[i] * v, G + i * width + m, sizeof(double) * v);
            return k;
        }
        for (int i = 0; i < m; i++) gain[i * m + i] = of.held[i] ? 0.0 : 1.0;
        for (int i = 0; i < of.free_controls; i++) memcpy(gain + of.control[i] * m, G + i * width, sizeof(double) * m);
        for (int j = 0; j < m; j++) {
            double *half = M + j * width + m, lead[MOST];
            solve_lower(v, v, L, half);
            memcpy(lead, half, sizeof(double) * v);
            solve_upper(v, v, L, lead);
            for (int i = 0; i < of.free_controls; i++) gain[of.control[i] * m + j] -= dot(v, G + i * width + m, lead);
        }
        for (int j = 0; j < m; j++)
            for (int i = j; i < m; i++)
                costs[i * m + j] = costs[j * m + i] =
                    M[j * width + i] - dot(v, M + i * width + m, M + j * width + m);
        hold_stiff(m, costs, ahead, &pending);
    }
    *free = pending;
    return -1;
}
