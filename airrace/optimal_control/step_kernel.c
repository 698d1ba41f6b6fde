/* The step of one shooting interval, its Jacobian and its Hessian, put together from those of f alone.
 *
 * Before this text stand the sizes, the scheme and the patterns of one model, see step_kernel.py, and
 * library_function.h. Elsewhere in the library stand rates, rates_* and projection_*: f(z; p) with z = (x, u), and the
 * Jacobians and Hessians of f and of the projection.
 *
 * With y = (x, u, T), the interval's share phi of T, and h = T g, g = phi / STEPS, the stages of one step are
 *
 *     X_i = x + h V_i,   V_i = sum_j a_ij K_j,   K_i = f(X_i, u),   x+ = x + h sum_i b_i K_i.
 *
 * Forward, with S_i = dz_i/dy:  dX_i = dx + h sum_j a_ij dK_j + g V_i e_T',    dK_i = f_z S_i.
 *
 * Backward, for lam . x+:  k_i = b_i lam + sum_j a_ji Xbar_j,    zbar_i = f_z' k_i,    Xbar_i = h zbar_i (its x),
 *
 *     lam <- lam + sum_i Xbar_i,   ubar = h sum_i zbar_i (its u),   Tbar = g sum_i k_i . K_i,
 *     Hessian = sum_i S_i' (h k_i . f)_zz S_i + e_T w' + w e_T',   w' = g sum_i zbar_i' S_i.
 *
 * The last two terms belong to the products h V_i and h K_i, whose factors both depend on y. Columns of y on which
 * nothing but the state itself depends (places, in still air) are left out: there S_i is the identity.
 */

/* For several intervals at once lanes.h stands before the tables and says what a `real` is; its functions are called by
 * the library's interface, see lane_interface.c. */
#ifdef LANES
#define KERNEL(name) int name##_of_lanes
#define RATES_ALONE rates_of_lanes
#else
typedef double real;
typedef long long int integer;
#define all(number) (number)
#if defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))
#else
#define EXPORT
#define INLINE static inline
#endif
#define KERNEL(name) EXPORT int name
#define RATES_ALONE rates
#endif

#define NZ (NX + NU)
#define NY (NX + NU + 1)

/* A loop over a whole row. Where every number is a vector it is written out, so that a row stays in registers, which
 * compilers do by themselves for the shortest rows only. */
#if defined(LANES) && defined(__clang__)
#define EVERY_COLUMN(c) _Pragma("clang loop unroll(full)") for (int c = 0; c < PADDED; c++)
#elif defined(LANES) && defined(__GNUC__)
#define EVERY_COLUMN(c) _Pragma("GCC unroll 32") for (int c = 0; c < PADDED; c++)
#else
#define EVERY_COLUMN(c) for (int c = 0; c < PADDED; c++)
#endif

/* Row-compressed pattern: entry e of row r is nonzero[source[e]] in column[e], start[r] <= e < start[r + 1]. */
struct sparse {
    int rows;
    const int *start, *column, *source;
};

/* Second derivatives: which variables they concern, their pattern among those, and by column of y which of them depend
 * on it. */
struct curvature {
    const int *variable;
    struct sparse hessian, dependent;
};

#define SPARSE(name, rows) {rows, name##_START, name##_COLUMN, name##_SOURCE}
static const struct sparse RATES = SPARSE(RATES_JACOBIAN, NX);
static const struct curvature RATES_CURVED = {
    RATES_VARIABLE, SPARSE(RATES_HESSIAN, RATES_VARIABLES), SPARSE(RATES_DEPENDENT, COLUMNS)};
#if PROJECTED
static const struct sparse PROJECTION = SPARSE(PROJECTION_JACOBIAN, NX);
static const struct curvature PROJECTION_CURVED = {
    PROJECTION_VARIABLE, SPARSE(PROJECTION_HESSIAN, PROJECTION_VARIABLES), SPARSE(PROJECTION_DEPENDENT, COLUMNS)};
#endif

/* One evaluation of f and what the backward sweep needs of it. PADDED is COLUMNS rounded up to whole groups of GROUP. */
struct stage {
    real z[NZ], jacobian[RATES_JACOBIAN_NONZEROS];
    real S[NZ][PADDED];
};

struct flight {
    const real *p;
    real y[NY], g, h;
    real x[NX];          /* the end, before the projection */
    real dx[NX][PADDED]; /* its sensitivity */
    real K[STEPS][STAGES][NX];
    struct stage stages[STEPS][STAGES];
};

/* calls of the generated functions */

typedef int generated(const real **arg, real **res, integer *iw, real *w, int mem);
generated RATES_ALONE, rates_linear, rates_curved, projection_linear, projection_curved;

INLINE int call(generated *function, const real *x, const real *u, const real *p, const real *lam, real *one, real *two)
{
    const real *arg[ARGUMENTS] = {x, u, p, lam};
    real *res[RESULTS] = {one, two};
    integer iw[INTEGERS];
    real w[REALS];
    return function(arg, res, iw, w, 0);
}

/* products */

INLINE void add_row(real *to, real factor, const real *from)
{
    EVERY_COLUMN(c) to[c] += factor * from[c];
}

INLINE void clear_row(real *row)
{
    EVERY_COLUMN(c) row[c] = all(0.0);
}

/* out = matrix S */
INLINE void multiply(const struct sparse *matrix, const real *nonzero, real (*S)[PADDED], real (*out)[PADDED])
{
    for (int r = 0; r < matrix->rows; r++) {
        real sum[PADDED];
        clear_row(sum);
        for (int e = matrix->start[r]; e < matrix->start[r + 1]; e++)
            add_row(sum, nonzero[matrix->source[e]], S[matrix->column[e]]);
        EVERY_COLUMN(c) out[r][c] = sum[c];
    }
}

/* out += matrix' v */
INLINE void multiply_transposed(const struct sparse *matrix, const real *nonzero, const real *v, real *out)
{
    for (int r = 0; r < matrix->rows; r++)
        for (int e = matrix->start[r]; e < matrix->start[r + 1]; e++)
            out[matrix->column[e]] += nonzero[matrix->source[e]] * v[r];
}

/* total += S' H S, its upper triangle and a little more */
INLINE void add_curvature(const struct curvature *of, const real *nonzero, real (*S)[PADDED], real (*total)[PADDED])
{
    real product[NZ][PADDED], picked[NZ][PADDED];
    for (int m = 0; m < of->hessian.rows; m++)
        EVERY_COLUMN(c) picked[m][c] = S[of->variable[m]][c];
    multiply(&of->hessian, nonzero, picked, product);
    for (int c = 0; c < COLUMNS; c++) {
        const int first = c / GROUP * GROUP;
        for (int e = of->dependent.start[c]; e < of->dependent.start[c + 1]; e++) {
            const int m = of->dependent.column[e];
            const real factor = picked[m][c];
            for (int b = first; b < PADDED; b++) total[c][b] += factor * product[m][b];
        }
    }
}

/* the forward sweep */

static void begin(struct flight *flight, const real **arg)
{
    for (int i = 0; i < NY; i++) flight->y[i] = arg[0] ? arg[0][i] : all(0.0);
    flight->p = arg[2];
    flight->g = arg[1] ? arg[1][0] / (double)STEPS : all(0.0);
    flight->h = flight->y[NY - 1] * flight->g;
    for (int r = 0; r < NX; r++) flight->x[r] = flight->y[r];
}

static void begin_sensitivity(struct flight *flight)
{
    for (int r = 0; r < NX; r++) {
        clear_row(flight->dx[r]);
        if (COLUMN_OF[r] >= 0) flight->dx[r][COLUMN_OF[r]] = all(1.0);
    }
}

/* dX_i for the states that f depends on, and the constant du */
INLINE void stage_sensitivity(
    struct flight *flight, struct stage *stage, int i, const real *V, real (*dK)[NX][PADDED])
{
    for (int s = 0; s < ACTING_STATES; s++) {
        const int r = ACTING_STATE[s];
        real *row = stage->S[r];
        EVERY_COLUMN(c) row[c] = flight->dx[r][c];
        for (int j = 0; j < i; j++)
            if (A[i][j] != 0.0) add_row(row, flight->h * A[i][j], dK[j][r]);
        row[COLUMNS - 1] += flight->g * V[r];
    }
    for (int r = NX; r < NZ; r++) {
        clear_row(stage->S[r]);
        stage->S[r][COLUMN_OF[r]] = all(1.0);
    }
}

/* V_i from the slopes before it, and z_i */
INLINE void stage_state(const struct flight *flight, real (*K)[NX], int i, real *V, real *z)
{
    for (int r = 0; r < NX; r++) {
        V[r] = all(0.0);
        for (int j = 0; j < i; j++)
            if (A[i][j] != 0.0) V[r] += A[i][j] * K[j][r];
        z[r] = flight->x[r] + flight->h * V[r];
    }
    for (int r = NX; r < NZ; r++) z[r] = flight->y[r];
}

/* x <- x + h times this */
INLINE real mean_slope(real (*K)[NX], int r)
{
    real slope = all(0.0);
    for (int i = 0; i < STAGES; i++)
        if (B[i] != 0.0) slope += B[i] * K[i][r];
    return slope;
}

/* one step without its sensitivity */
static int plain_step(struct flight *flight, real (*K)[NX])
{
    for (int i = 0; i < STAGES; i++) {
        real V[NX], z[NZ];
        stage_state(flight, K, i, V, z);
        if (call(RATES_ALONE, z, z + NX, flight->p, 0, K[i], 0)) return 1;
    }
    for (int r = 0; r < NX; r++) flight->x[r] += flight->h * mean_slope(K, r);
    return 0;
}

static int one_step(struct flight *flight, struct stage *stages, real (*K)[NX])
{
    real dK[STAGES][NX][PADDED];
    for (int i = 0; i < STAGES; i++) {
        struct stage *stage = stages + i;
        real V[NX];
        stage_state(flight, K, i, V, stage->z);
        if (call(rates_linear, stage->z, stage->z + NX, flight->p, 0, K[i], stage->jacobian)) return 1;
        stage_sensitivity(flight, stage, i, V, dK);
        multiply(&RATES, stage->jacobian, stage->S, dK[i]);
    }
    for (int r = 0; r < NX; r++) {
        const real slope = mean_slope(K, r);
        flight->x[r] += flight->h * slope;
        for (int i = 0; i < STAGES; i++)
            if (B[i] != 0.0) add_row(flight->dx[r], flight->h * B[i], dK[i][r]);
        flight->dx[r][COLUMNS - 1] += flight->g * slope;
    }
    return 0;
}

/* the backward sweep */

static int one_step_back(
    const struct flight *flight, struct stage *stages, real (*K)[NX], real *lam, real *gradient, real *w,
    real (*hessian)[PADDED])
{
    real zbar[STAGES][NZ] = {{all(0.0)}};
    for (int i = STAGES - 1; i >= 0; i--) {
        struct stage *stage = stages + i;
        real k[NX], weighted[NX], nonzero[RATES_HESSIAN_NONZEROS];
        for (int r = 0; r < NX; r++) k[r] = B[i] * lam[r];
        for (int j = i + 1; j < STAGES; j++)
            for (int r = 0; r < NX; r++) k[r] += A[j][i] * flight->h * zbar[j][r];
        for (int r = 0; r < NX; r++) {
            weighted[r] = flight->h * k[r];
            gradient[NY - 1] += flight->g * k[r] * K[i][r];
        }
        multiply_transposed(&RATES, stage->jacobian, k, zbar[i]);
        for (int r = NX; r < NZ; r++) gradient[r] += flight->h * zbar[i][r];
        for (int s = 0; s < ACTING_STATES; s++)
            add_row(w, flight->g * zbar[i][ACTING_STATE[s]], stage->S[ACTING_STATE[s]]);
        for (int r = NX; r < NZ; r++) w[COLUMN_OF[r]] += flight->g * zbar[i][r];
        if (call(rates_curved, stage->z, stage->z + NX, flight->p, weighted, nonzero, 0)) return 1;
        add_curvature(&RATES_CURVED, nonzero, stage->S, hessian);
    }
    for (int i = 0; i < STAGES; i++)
        for (int r = 0; r < NX; r++) lam[r] += flight->h * zbar[i][r];
    return 0;
}

/* the projection at the end; without one the end is what it is */

static int project(struct flight *flight, real *value, real (*jacobian)[PADDED])
{
#if PROJECTED
    real nonzero[PROJECTION_JACOBIAN_NONZEROS];
    if (call(projection_linear, flight->x, 0, 0, 0, value, nonzero)) return 1;
    multiply(&PROJECTION, nonzero, flight->dx, jacobian);
    return 0;
#else
    for (int r = 0; r < NX; r++)
        EVERY_COLUMN(c) jacobian[r][c] = flight->dx[r][c];
    for (int r = 0; r < NX; r++) value[r] = flight->x[r];
    return 0;
#endif
}

/* multipliers of the projected state become those of the end itself */
static int project_back(struct flight *flight, real *lam, real (*hessian)[PADDED])
{
#if PROJECTED
    real jacobian[PROJECTION_JACOBIAN_NONZEROS], nonzero[PROJECTION_HESSIAN_NONZEROS], before[NX] = {all(0.0)};
    if (call(projection_linear, flight->x, 0, 0, 0, 0, jacobian)) return 1;
    if (call(projection_curved, flight->x, lam, 0, 0, nonzero, 0)) return 1;
    multiply_transposed(&PROJECTION, jacobian, lam, before);
    for (int r = 0; r < NX; r++) lam[r] = before[r];
    add_curvature(&PROJECTION_CURVED, nonzero, flight->dx, hessian);
#endif
    return 0;
}

/* the step and its derivatives */

KERNEL(step)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    struct flight flight;
    begin(&flight, arg);
    for (int n = 0; n < STEPS; n++)
        if (plain_step(&flight, flight.K[n])) return 1;
    if (!res[0]) return 0;
#if PROJECTED
    return call(projection_linear, flight.x, 0, 0, 0, res[0], 0);
#else
    for (int r = 0; r < NX; r++) res[0][r] = flight.x[r];
    return 0;
#endif
}

KERNEL(step_jacobian)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    struct flight flight;
    real value[NX], jacobian[NX][PADDED];
    begin(&flight, arg);
    begin_sensitivity(&flight);
    for (int n = 0; n < STEPS; n++)
        if (one_step(&flight, flight.stages[n], flight.K[n])) return 1;
    if (project(&flight, value, jacobian)) return 1;
    if (res[0])
        for (int r = 0; r < NX; r++) res[0][r] = value[r];
    const real *entry = &jacobian[0][0];
    if (res[1])
        for (int e = 0; e < JACOBIAN_NONZEROS; e++) res[1][e] = JACOBIAN_SOURCE[e] < 0 ? all(1.0) : entry[JACOBIAN_SOURCE[e]];
    return 0;
}

KERNEL(step_hessian)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    struct flight flight;
    real lam[NX], gradient[NY] = {all(0.0)}, through_T[PADDED] = {all(0.0)};
    real hessian[COLUMNS][PADDED] = {{all(0.0)}};
    begin(&flight, arg);
    begin_sensitivity(&flight);
    for (int n = 0; n < STEPS; n++)
        if (one_step(&flight, flight.stages[n], flight.K[n])) return 1;
    for (int r = 0; r < NX; r++) lam[r] = arg[3] ? arg[3][r] : all(0.0);
    if (project_back(&flight, lam, hessian)) return 1;
    for (int n = STEPS - 1; n >= 0; n--)
        if (one_step_back(&flight, flight.stages[n], flight.K[n], lam, gradient, through_T, hessian)) return 1;
    for (int c = 0; c < COLUMNS; c++) hessian[c][COLUMNS - 1] += through_T[c];
    hessian[COLUMNS - 1][COLUMNS - 1] += through_T[COLUMNS - 1];
    for (int r = 0; r < NX; r++) gradient[r] = lam[r];
    if (res[0])
        for (int i = 0; i < NY; i++) res[0][i] = gradient[i];
    const real *entry = &hessian[0][0];
    if (res[1])
        for (int e = 0; e < HESSIAN_NONZEROS; e++) res[1][e] = entry[HESSIAN_SOURCE[e]];
    return 0;
}

/* what casadi asks, see library_function.h; the library's interface answers for several intervals */

#ifndef LANES
static const integer *const step_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P};
static const integer *const step_jacobian_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P};
static const integer *const step_hessian_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P, PATTERN_X};
static const integer *const step_OUT[] = {PATTERN_X};
static const integer *const step_jacobian_OUT[] = {PATTERN_X, PATTERN_JACOBIAN};
static const integer *const step_hessian_OUT[] = {PATTERN_Y, PATTERN_HESSIAN};
WHAT_CASADI_ASKS(step, 3, 1)
WHAT_CASADI_ASKS(step_jacobian, 3, 2)
WHAT_CASADI_ASKS(step_hessian, 4, 2)
#endif
