/* The step of one shooting interval, its Jacobian and its Hessian, put together from those of f alone, for any model.
 *
 * Before this text stands what evaluates f(z; p) with z = (x, u), and the Jacobians and Hessians of f and of the
 * projection: interpreter.c or compiled_functions.c. The model's sizes and patterns are tables, see step_tables.py.
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

/* Rows of matrices with a column per active entry of y have PADDED numbers, a multiple of GROUP. */
enum { GROUP = 4 };
struct model {
    const int *size, *column_of, *acting_state, *jacobian_source, *hessian_source;
    const double *A, *B;
    struct sparse rates_jacobian, projection_jacobian;
    struct curvature rates_hessian, projection_hessian;
    struct function rates, rates_linear, rates_curved, projection_linear, projection_curved;
};

#define NX (model->size[0])
#define NU (model->size[1])
#define NP (model->size[2])
#define STAGES (model->size[3])
#define STEPS (model->size[4])
#define COLUMNS (model->size[5])
#define PADDED (model->size[6])
#define ACTING_STATES (model->size[7])
#define PROJECTED (model->size[8])
#define JACOBIAN_NONZEROS (model->size[9])
#define HESSIAN_NONZEROS (model->size[10])
#define RATES_NONZEROS (model->size[11])
#define MOST_NONZEROS (model->size[12])
#define NZ (NX + NU)
#define NY (NX + NU + 1)

/* What a flight through an interval leaves behind, each in memory of its own. Of one stage are z, K, jacobian and S,
 * and there are as many as the stages of all steps. */
struct flight {
    real g, h, *y, *x, *dx;               /* x: the end, before the projection; dx: its sensitivity */
    real *z, *K, *jacobian, *S;           /* of all stages */
    real *V, *dK, *nonzero, *end, *rows;  /* dK: of the stages of one step; rows: twice NZ, for one product */
    real *lam, *gradient, *w, *zbar, *k, *weighted, *hessian;
};

#define ROW(matrix, r) ((matrix) + (r) * PADDED)

/* A row is computed in parts, whose sums stay in registers: `part` for `width` columns from `first` on. */
enum { WIDEST = 2 * GROUP };
#if defined(__clang__)
#define EVERY_COLUMN(c) _Pragma("clang loop unroll(full)") for (int c = 0; c < width; c++)
#elif defined(__GNUC__)
#define EVERY_COLUMN(c) _Pragma("GCC unroll 8") for (int c = 0; c < width; c++)
#else
#define EVERY_COLUMN(c) for (int c = 0; c < width; c++)
#endif
#define IN_PARTS(part, begin, ...)                                                                                    \
    do {                                                                                                              \
        int first = begin;                                                                                            \
        for (; first + WIDEST <= PADDED; first += WIDEST) part(first, WIDEST, __VA_ARGS__);                           \
        if (first < PADDED) part(first, GROUP, __VA_ARGS__);                                                          \
    } while (0)

/* products */

INLINE void add_row(const struct model *model, real *to, real factor, const real *from)
{
    const int padded = PADDED;
    for (int c = 0; c < padded; c++) to[c] += factor * from[c];
}

INLINE void product_part(
    int first, int width, int padded, const struct sparse *matrix, int r, const real *nonzero, const real *S, real *out)
{
    real sum[WIDEST];
    const int *column = matrix->column, *source = matrix->source, end = matrix->start[r + 1];
    EVERY_COLUMN(c) sum[c] = all(0.0);
    for (int e = matrix->start[r]; e < end; e++) {
        const real factor = nonzero[source[e]], *from = S + column[e] * padded + first;
        EVERY_COLUMN(c) sum[c] += factor * from[c];
    }
    EVERY_COLUMN(c) out[first + c] = sum[c];
}

/* out = matrix S */
static void multiply(
    const struct model *model, const struct sparse *matrix, const real *nonzero, const real *S, real *out)
{
    for (int r = 0; r < matrix->rows; r++)
        IN_PARTS(product_part, 0, PADDED, matrix, r, nonzero, S, ROW(out, r));
}

/* out += matrix' v */
static void multiply_transposed(const struct sparse *matrix, const real *nonzero, const real *v, real *out)
{
    for (int r = 0; r < matrix->rows; r++)
        for (int e = matrix->start[r]; e < matrix->start[r + 1]; e++)
            out[matrix->column[e]] += nonzero[matrix->source[e]] * v[r];
}

INLINE void curvature_part(
    int first, int width, int padded, const struct sparse *dependent, int c, const real *picked, const real *product,
    real *out)
{
    real sum[WIDEST];
    const int *column = dependent->column, end = dependent->start[c + 1];
    EVERY_COLUMN(b) sum[b] = out[first + b];
    for (int e = dependent->start[c]; e < end; e++) {
        const int m = column[e] * padded;
        const real factor = picked[m + c], *from = product + m + first;
        EVERY_COLUMN(b) sum[b] += factor * from[b];
    }
    EVERY_COLUMN(b) out[first + b] = sum[b];
}

/* total += S' H S, its upper triangle and a little more */
static void add_curvature(
    const struct model *model, struct flight *flight, const struct curvature *of, const real *S, real *total)
{
    real *picked = flight->rows, *product = ROW(flight->rows, NZ);
    for (int m = 0; m < of->hessian.rows; m++) copy(ROW(S, of->variable[m]), PADDED, ROW(picked, m));
    multiply(model, &of->hessian, flight->nonzero, picked, product);
    for (int c = 0; c < COLUMNS; c++)
        IN_PARTS(curvature_part, c / GROUP * GROUP, PADDED, &of->dependent, c, picked, product, ROW(total, c));
}

/* the forward sweep */

INLINE void sum_part(
    int first, int width, const real *row, int terms, const real *factor, const real *const *from, real *out)
{
    real sum[WIDEST];
    EVERY_COLUMN(c) sum[c] = row[first + c];
    for (int j = 0; j < terms; j++) {
        const real by = factor[j], *column = from[j] + first;
        EVERY_COLUMN(c) sum[c] += by * column[c];
    }
    EVERY_COLUMN(c) out[first + c] = sum[c];
}

/* out = row r of dx + h sum_j weights_j dK_j */
static void advanced_row(
    const struct model *model, const struct flight *flight, int r, const double *weights, int count, real *out)
{
    const real *dK[STAGES];
    real factor[STAGES];
    int terms = 0;
    for (int j = 0; j < count; j++) {
        if (weights[j] == 0.0) continue;
        factor[terms] = flight->h * weights[j];
        dK[terms++] = ROW(flight->dK, j * NX + r);
    }
    IN_PARTS(sum_part, 0, ROW(flight->dx, r), terms, factor, dK, out);
}

static void begin_sensitivity(const struct model *model, struct flight *flight)
{
    clear(flight->dx, NX * PADDED);
    for (int r = 0; r < NX; r++)
        if (model->column_of[r] >= 0) ROW(flight->dx, r)[model->column_of[r]] = all(1.0);
}

/* dX_i for the states that f depends on, and the constant du */
static void stage_sensitivity(const struct model *model, struct flight *flight, int i, real *S)
{
    for (int s = 0; s < ACTING_STATES; s++) {
        const int r = model->acting_state[s];
        advanced_row(model, flight, r, model->A + i * STAGES, i, ROW(S, r));
        ROW(S, r)[COLUMNS - 1] += flight->g * flight->V[r];
    }
    clear(ROW(S, NX), NU * PADDED);
    for (int r = NX; r < NZ; r++) ROW(S, r)[model->column_of[r]] = all(1.0);
}

/* sum_j weights_j K_j */
INLINE real weighted_slope(const struct model *model, const double *weights, int count, const real *K, int r)
{
    real slope = all(0.0);
    for (int j = 0; j < count; j++)
        if (weights[j] != 0.0) slope += weights[j] * K[j * NX + r];
    return slope;
}

/* V_i from the slopes before it, and z_i */
static void stage_state(const struct model *model, struct flight *flight, const real *K, int i, real *z)
{
    for (int r = 0; r < NX; r++) {
        flight->V[r] = weighted_slope(model, model->A + i * STAGES, i, K, r);
        z[r] = flight->x[r] + flight->h * flight->V[r];
    }
    copy(flight->y + NX, NU, z + NX);
}

/* one step without its sensitivity */
static void plain_step(const struct model *model, struct flight *flight)
{
    real *z = flight->z, *K = flight->K;
    for (int i = 0; i < STAGES; i++) {
        stage_state(model, flight, K, i, z);
        call(&model->rates, (const real *[]){z, z + NX, 0, 0}, (real *[]){K + i * NX, 0});
    }
    for (int r = 0; r < NX; r++) flight->x[r] += flight->h * weighted_slope(model, model->B, STAGES, K, r);
}

static void one_step(const struct model *model, struct flight *flight, int n)
{
    real *K = flight->K + n * STAGES * NX;
    for (int i = 0; i < STAGES; i++) {
        const int s = n * STAGES + i;
        real *z = flight->z + s * NZ, *S = ROW(flight->S, s * NZ), *jacobian = flight->jacobian + s * RATES_NONZEROS;
        stage_state(model, flight, K, i, z);
        call(&model->rates_linear, (const real *[]){z, z + NX, 0, 0}, (real *[]){K + i * NX, jacobian});
        stage_sensitivity(model, flight, i, S);
        multiply(model, &model->rates_jacobian, jacobian, S, ROW(flight->dK, i * NX));
    }
    for (int r = 0; r < NX; r++) {
        const real slope = weighted_slope(model, model->B, STAGES, K, r);
        flight->x[r] += flight->h * slope;
        advanced_row(model, flight, r, model->B, STAGES, ROW(flight->dx, r));
        ROW(flight->dx, r)[COLUMNS - 1] += flight->g * slope;
    }
}

/* the backward sweep */

/* of stage i: weighted = h k_i and zbar_i, and what they add to Tbar, ubar and w */
static void stage_back(
    const struct model *model, struct flight *flight, int i, const real *K, const real *S, const real *jacobian)
{
    real *k = flight->k, *zbar = flight->zbar + i * NZ;
    for (int r = 0; r < NX; r++) k[r] = model->B[i] * flight->lam[r];
    for (int j = i + 1; j < STAGES; j++)
        for (int r = 0; r < NX; r++) k[r] += model->A[j * STAGES + i] * flight->h * flight->zbar[j * NZ + r];
    for (int r = 0; r < NX; r++) {
        flight->weighted[r] = flight->h * k[r];
        flight->gradient[NY - 1] += flight->g * k[r] * K[r];
    }
    clear(zbar, NZ);
    multiply_transposed(&model->rates_jacobian, jacobian, k, zbar);
    for (int r = NX; r < NZ; r++) flight->gradient[r] += flight->h * zbar[r];
    for (int s = 0; s < ACTING_STATES; s++) {
        const int r = model->acting_state[s];
        add_row(model, flight->w, flight->g * zbar[r], ROW(S, r));
    }
    for (int r = NX; r < NZ; r++) flight->w[model->column_of[r]] += flight->g * zbar[r];
}

static void one_step_back(const struct model *model, struct flight *flight, int n)
{
    for (int i = STAGES - 1; i >= 0; i--) {
        const int s = n * STAGES + i;
        const real *z = flight->z + s * NZ, *S = ROW(flight->S, s * NZ);
        stage_back(model, flight, i, flight->K + s * NX, S, flight->jacobian + s * RATES_NONZEROS);
        call(
            &model->rates_curved, (const real *[]){z, z + NX, 0, flight->weighted}, (real *[]){flight->nonzero, 0});
        add_curvature(model, flight, &model->rates_hessian, S, flight->hessian);
    }
    for (int i = 0; i < STAGES; i++)
        for (int r = 0; r < NX; r++) flight->lam[r] += flight->h * flight->zbar[i * NZ + r];
}

/* the projection at the end; without one the end is what it is */

static void project(const struct model *model, struct flight *flight, real *value)
{
    call(&model->projection_linear, (const real *[]){flight->x, 0, 0, 0}, (real *[]){value, flight->nonzero});
}

/* multipliers of the projected state become those of the end itself */
static void project_back(const struct model *model, struct flight *flight)
{
    real *lam = flight->lam, *before = flight->k;
    project(model, flight, flight->V);
    clear(before, NX);
    multiply_transposed(&model->projection_jacobian, flight->nonzero, lam, before);
    call(&model->projection_curved, (const real *[]){flight->x, lam, 0, 0}, (real *[]){flight->nonzero, 0});
    copy(before, NX, lam);
    add_curvature(model, flight, &model->projection_hessian, flight->dx, flight->hessian);
}

/* the step and its derivatives */

static void find_end(const struct model *model, struct flight *flight)
{
    for (int n = 0; n < STEPS; n++) plain_step(model, flight);
    if (PROJECTED) project(model, flight, flight->x);
}

/* `end` becomes the sensitivity of x */
static void find_jacobian(const struct model *model, struct flight *flight)
{
    begin_sensitivity(model, flight);
    for (int n = 0; n < STEPS; n++) one_step(model, flight, n);
    flight->end = flight->dx;
    if (!PROJECTED) return;
    project(model, flight, flight->x);
    flight->end = flight->dK;
    multiply(model, &model->projection_jacobian, flight->nonzero, flight->dx, flight->end);
}

static void find_hessian(const struct model *model, struct flight *flight)
{
    begin_sensitivity(model, flight);
    clear(flight->gradient, NY);
    clear(flight->w, PADDED);
    clear(flight->hessian, COLUMNS * PADDED);
    for (int n = 0; n < STEPS; n++) one_step(model, flight, n);
    if (PROJECTED) project_back(model, flight);
    for (int n = STEPS - 1; n >= 0; n--) one_step_back(model, flight, n);
    for (int c = 0; c < COLUMNS; c++) ROW(flight->hessian, c)[COLUMNS - 1] += flight->w[c];
    ROW(flight->hessian, COLUMNS - 1)[COLUMNS - 1] += flight->w[COLUMNS - 1];
    copy(flight->lam, NX, flight->gradient);
}

/* numbers from places, of which -1 holds a one */
static void draw(const real *from, const int *place, int size, real *to)
{
    for (int e = 0; e < size; e++) to[e] = place[e] < 0 ? all(1.0) : from[place[e]];
}

static void given_or_zero(const real *from, int size, real *to)
{
    if (from) copy(from, size, to);
    else clear(to, size);
}

/* What casadi would ask of (y, phi, p[, lam]): the end (order 0), the end and its Jacobian (1), or the gradient and the
 * Hessian of lam . x+ (2). Null arguments are zero, and null results are not asked for. */
static void evaluate_step(
    const struct model *model, struct flight *flight, int order, const real *const *given, real *const *found)
{
    given_or_zero(given[0], NY, flight->y);
    given_or_zero(given[1], 1, &flight->g);
    flight->g /= (double)STEPS;
    flight->h = flight->y[NY - 1] * flight->g;
    copy(flight->y, NX, flight->x);
    if (order == 2) given_or_zero(given[3], NX, flight->lam);
    (order == 0 ? find_end : order == 1 ? find_jacobian : find_hessian)(model, flight);
    if (found[0] && order < 2) copy(flight->x, NX, found[0]);
    if (found[0] && order == 2) copy(flight->gradient, NY, found[0]);
    if (order == 1 && found[1]) draw(flight->end, model->jacobian_source, JACOBIAN_NONZEROS, found[1]);
    if (order == 2 && found[1]) draw(flight->hessian, model->hessian_source, HESSIAN_NONZEROS, found[1]);
}
