/* The step of one shooting interval, its Jacobian and its Hessian.
 *
 * With y = (x, u, T), the interval's share phi of T, and h = T g, g = phi / steps, the stages of one step are
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
 * nothing but the state itself depends (positions, in still air) are left out: there S_i is the identity.
 */
#include "step.h"

/* Rows of sensitivities are computed in parts of at most WIDEST columns, whose sums stay in registers. */
enum { GROUP = 4, WIDEST = 2 * GROUP };

/* of a Runge-Kutta scheme */
enum { MOST_STAGES = 16 };

INLINE real *row(const struct model *model, real *matrix, int r)
{
    return matrix + r * model->size->padded;
}

INLINE const real *const_row(const struct model *model, const real *matrix, int r)
{
    return matrix + r * model->size->padded;
}

/* products */

INLINE void add_row(const struct model *model, real *to, real factor, const real *from)
{
    const int padded = model->size->padded;
    for (int c = 0; c < padded; c++) to[c] += factor * from[c];
}

INLINE void multiply_part(
    int first, int width, int padded, const struct sparse *matrix, int r, const real *nonzero, const real *S, real *out)
{
    real sum[WIDEST];
    const int *column = matrix->column, *source = matrix->source, end = matrix->start[r + 1];
    UNROLL for (int c = 0; c < width; c++) sum[c] = broadcast(0.0);
    for (int e = matrix->start[r]; e < end; e++) {
        const real factor = nonzero[source[e]], *from = S + column[e] * padded + first;
        UNROLL for (int c = 0; c < width; c++) sum[c] += factor * from[c];
    }
    UNROLL for (int c = 0; c < width; c++) out[first + c] = sum[c];
}

/* out = matrix S */
static void multiply(const struct model *model, const struct sparse *matrix, const real *nonzero, const real *S, real *out)
{
    const int padded = model->size->padded;
    for (int r = 0; r < matrix->rows; r++, out += padded) {
        int first = 0;
        for (; first + WIDEST <= padded; first += WIDEST)
            multiply_part(first, WIDEST, padded, matrix, r, nonzero, S, out);
        if (first < padded) multiply_part(first, GROUP, padded, matrix, r, nonzero, S, out);
    }
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
    UNROLL for (int b = 0; b < width; b++) sum[b] = out[first + b];
    for (int e = dependent->start[c]; e < end; e++) {
        const int m = column[e] * padded;
        const real factor = picked[m + c], *from = product + m + first;
        UNROLL for (int b = 0; b < width; b++) sum[b] += factor * from[b];
    }
    UNROLL for (int b = 0; b < width; b++) out[first + b] = sum[b];
}

/* total += S' H S, its upper triangle and a little more */
static void add_curvature(
    const struct model *model, struct sweep *sweep, const struct curvature *of, const real *S, real *total)
{
    const int padded = model->size->padded, nz = model->size->nx + model->size->nu;
    real *picked = sweep->rows, *product = row(model, sweep->rows, nz);
    for (int m = 0; m < of->hessian.rows; m++) copy(const_row(model, S, of->variable[m]), padded, row(model, picked, m));
    multiply(model, &of->hessian, sweep->nonzero, picked, product);
    for (int c = 0; c < model->size->active; c++, total += padded) {
        int first = c / GROUP * GROUP;
        for (; first + WIDEST <= padded; first += WIDEST)
            curvature_part(first, WIDEST, padded, &of->dependent, c, picked, product, total);
        if (first < padded) curvature_part(first, GROUP, padded, &of->dependent, c, picked, product, total);
    }
}

/* the forward sweep */

INLINE void advance_part(
    int first, int width, const real *from_row, int terms, const real *factor, const real *const *from, real *out)
{
    real sum[WIDEST];
    UNROLL for (int c = 0; c < width; c++) sum[c] = from_row[first + c];
    for (int j = 0; j < terms; j++) {
        const real by = factor[j], *column = from[j] + first;
        UNROLL for (int c = 0; c < width; c++) sum[c] += by * column[c];
    }
    UNROLL for (int c = 0; c < width; c++) out[first + c] = sum[c];
}

/* out = row r of dx + h sum_j weights_j dK_j */
static void advance_row(
    const struct model *model, const struct sweep *sweep, int r, const double *weights, int count, real *out)
{
    const int padded = model->size->padded;
    const real *dK[MOST_STAGES], *dx = const_row(model, sweep->dx, r);
    real factor[MOST_STAGES];
    int terms = 0, first = 0;
    for (int j = 0; j < count; j++) {
        if (weights[j] == 0.0) continue;
        factor[terms] = sweep->h * weights[j];
        dK[terms++] = row(model, sweep->dK, j * model->size->nx + r);
    }
    for (; first + WIDEST <= padded; first += WIDEST) advance_part(first, WIDEST, dx, terms, factor, dK, out);
    if (first < padded) advance_part(first, GROUP, dx, terms, factor, dK, out);
}

static void begin_sensitivity(const struct model *model, struct sweep *sweep)
{
    const int nx = model->size->nx;
    fill(sweep->dx, nx * model->size->padded, 0.0);
    for (int r = 0; r < nx; r++)
        if (model->column_of[r] >= 0) row(model, sweep->dx, r)[model->column_of[r]] = broadcast(1.0);
}

/* dX_i for the states that f depends on, and the constant du */
static void stage_sensitivity(const struct model *model, struct sweep *sweep, int i, real *S)
{
    const struct sizes *size = model->size;
    for (int s = 0; s < size->acting; s++) {
        const int r = model->acting_state[s];
        advance_row(model, sweep, r, model->A + i * size->stages, i, row(model, S, r));
        row(model, S, r)[size->active - 1] += sweep->g * sweep->V[r];
    }
    fill(row(model, S, size->nx), size->nu * size->padded, 0.0);
    for (int r = size->nx; r < size->nx + size->nu; r++) row(model, S, r)[model->column_of[r]] = broadcast(1.0);
}

/* sum_j weights_j K_j of state r */
INLINE real weighted_slope(const struct model *model, const double *weights, int count, const real *K, int r)
{
    real slope = broadcast(0.0);
    for (int j = 0; j < count; j++)
        if (weights[j] != 0.0) slope += weights[j] * K[j * model->size->nx + r];
    return slope;
}

/* V_i from the slopes before it, and z_i */
static void stage_state(const struct model *model, struct sweep *sweep, const real *K, int i, real *z)
{
    const int nx = model->size->nx;
    for (int r = 0; r < nx; r++) {
        sweep->V[r] = weighted_slope(model, model->A + i * model->size->stages, i, K, r);
        z[r] = sweep->x[r] + sweep->h * sweep->V[r];
    }
    copy(sweep->y + nx, model->size->nu, z + nx);
}

/* one step without its sensitivity */
static void advance(const struct model *model, struct sweep *sweep)
{
    const int nx = model->size->nx, stages = model->size->stages;
    real *z = sweep->z, *K = sweep->K;
    for (int i = 0; i < stages; i++) {
        stage_state(model, sweep, K, i, z);
        call(&model->rates, (const real *[]){z, z + nx, NULL, NULL}, (real *[]){K + i * nx, NULL});
    }
    for (int r = 0; r < nx; r++) sweep->x[r] += sweep->h * weighted_slope(model, model->B, stages, K, r);
}

/* step n with its sensitivity */
static void advance_sensitivity(const struct model *model, struct sweep *sweep, int n)
{
    const struct sizes *size = model->size;
    const int nx = size->nx, nz = nx + size->nu, stages = size->stages;
    real *K = sweep->K + n * stages * nx;
    for (int i = 0; i < stages; i++) {
        const int s = n * stages + i;
        real *z = sweep->z + s * nz, *S = row(model, sweep->S, s * nz);
        real *jacobian = sweep->jacobian + s * size->rates_nonzeros;
        stage_state(model, sweep, K, i, z);
        call(&model->rates_linear, (const real *[]){z, z + nx, NULL, NULL}, (real *[]){K + i * nx, jacobian});
        stage_sensitivity(model, sweep, i, S);
        multiply(model, &model->rates_jacobian, jacobian, S, row(model, sweep->dK, i * nx));
    }
    for (int r = 0; r < nx; r++) {
        const real slope = weighted_slope(model, model->B, stages, K, r);
        sweep->x[r] += sweep->h * slope;
        advance_row(model, sweep, r, model->B, stages, row(model, sweep->dx, r));
        row(model, sweep->dx, r)[size->active - 1] += sweep->g * slope;
    }
}

/* the backward sweep */

/* of stage i: weighted = h k_i and zbar_i, and what they add to Tbar, ubar and w */
static void stage_adjoint(
    const struct model *model, struct sweep *sweep, int i, const real *K, const real *S, const real *jacobian)
{
    const struct sizes *size = model->size;
    const int nx = size->nx, nz = nx + size->nu;
    real *k = sweep->k, *zbar = sweep->zbar + i * nz;
    for (int r = 0; r < nx; r++) k[r] = model->B[i] * sweep->lam[r];
    for (int j = i + 1; j < size->stages; j++)
        for (int r = 0; r < nx; r++) k[r] += model->A[j * size->stages + i] * sweep->h * sweep->zbar[j * nz + r];
    for (int r = 0; r < nx; r++) {
        sweep->weighted[r] = sweep->h * k[r];
        sweep->gradient[nz] += sweep->g * k[r] * K[r];
    }
    fill(zbar, nz, 0.0);
    multiply_transposed(&model->rates_jacobian, jacobian, k, zbar);
    for (int r = nx; r < nz; r++) sweep->gradient[r] += sweep->h * zbar[r];
    for (int s = 0; s < size->acting; s++) {
        const int r = model->acting_state[s];
        add_row(model, sweep->w, sweep->g * zbar[r], const_row(model, S, r));
    }
    for (int r = nx; r < nz; r++) sweep->w[model->column_of[r]] += sweep->g * zbar[r];
}

static void step_adjoint(const struct model *model, struct sweep *sweep, int n)
{
    const struct sizes *size = model->size;
    const int nx = size->nx, nz = nx + size->nu;
    for (int i = size->stages - 1; i >= 0; i--) {
        const int s = n * size->stages + i;
        const real *z = sweep->z + s * nz, *S = row(model, sweep->S, s * nz);
        stage_adjoint(model, sweep, i, sweep->K + s * nx, S, sweep->jacobian + s * size->rates_nonzeros);
        call(
            &model->rates_curved, (const real *[]){z, z + nx, NULL, sweep->weighted}, (real *[]){sweep->nonzero, NULL});
        add_curvature(model, sweep, &model->rates_hessian, S, sweep->hessian);
    }
    for (int i = 0; i < size->stages; i++)
        for (int r = 0; r < nx; r++) sweep->lam[r] += sweep->h * sweep->zbar[i * nz + r];
}

/* the projection at the end; without one the end is what it is */

static void project(const struct model *model, struct sweep *sweep, real *value)
{
    call(
        &model->projection_linear, (const real *[]){sweep->x, NULL, NULL, NULL}, (real *[]){value, sweep->nonzero});
}

/* multipliers of the projected state become those of the end itself; V becomes the former */
static void project_adjoint(const struct model *model, struct sweep *sweep)
{
    const int nx = model->size->nx;
    real *lam = sweep->lam, *before = sweep->k;
    project(model, sweep, sweep->V);
    sweep->end = sweep->dK;
    multiply(model, &model->projection_jacobian, sweep->nonzero, sweep->dx, sweep->end);
    fill(before, nx, 0.0);
    multiply_transposed(&model->projection_jacobian, sweep->nonzero, lam, before);
    call(&model->projection_curved, (const real *[]){sweep->x, lam, NULL, NULL}, (real *[]){sweep->nonzero, NULL});
    copy(before, nx, lam);
    add_curvature(model, sweep, &model->projection_hessian, sweep->dx, sweep->hessian);
}

/* the whole interval */

static void find_end(const struct model *model, struct sweep *sweep)
{
    for (int n = 0; n < model->size->steps; n++) advance(model, sweep);
    if (model->size->projected) project(model, sweep, sweep->x);
}

/* `end` becomes the sensitivity of x */
static void find_jacobian(const struct model *model, struct sweep *sweep)
{
    begin_sensitivity(model, sweep);
    for (int n = 0; n < model->size->steps; n++) advance_sensitivity(model, sweep, n);
    sweep->end = sweep->dx;
    if (!model->size->projected) return;
    project(model, sweep, sweep->x);
    sweep->end = sweep->dK;
    multiply(model, &model->projection_jacobian, sweep->nonzero, sweep->dx, sweep->end);
}

static void find_hessian(const struct model *model, struct sweep *sweep)
{
    const struct sizes *size = model->size;
    const int last = size->active - 1;
    begin_sensitivity(model, sweep);
    fill(sweep->gradient, size->nx + size->nu + 1, 0.0);
    fill(sweep->w, size->padded, 0.0);
    fill(sweep->hessian, size->active * size->padded, 0.0);
    for (int n = 0; n < size->steps; n++) advance_sensitivity(model, sweep, n);
    sweep->end = sweep->dx;
    if (size->projected) project_adjoint(model, sweep);
    for (int n = size->steps - 1; n >= 0; n--) step_adjoint(model, sweep, n);
    for (int c = 0; c < size->active; c++) row(model, sweep->hessian, c)[last] += sweep->w[c];
    row(model, sweep->hessian, last)[last] += sweep->w[last];
    copy(sweep->lam, size->nx, sweep->gradient);
}

/* numbers from places, of which -1 holds a one */
static void pick(const real *from, const int *place, int size, real *to)
{
    for (int e = 0; e < size; e++) to[e] = place[e] < 0 ? broadcast(1.0) : from[place[e]];
}

void evaluate_step(
    const struct model *model, struct sweep *sweep, int order, const real *const given[ARGUMENTS],
    real *const found[STEP_RESULTS])
{
    const struct sizes *size = model->size;
    const int nx = size->nx, ny = nx + size->nu + 1;
    copy(given[0], ny, sweep->y);
    sweep->g = given[1][0] / (double)size->steps;
    sweep->h = sweep->y[ny - 1] * sweep->g;
    copy(sweep->y, nx, sweep->x);
    if (order == 0) {
        find_end(model, sweep);
        copy(sweep->x, nx, found[0]);
    } else if (order == 1) {
        find_jacobian(model, sweep);
        copy(sweep->x, nx, found[0]);
        pick(sweep->end, model->jacobian_source, size->jacobian_nonzeros, found[1]);
    } else {
        copy(given[3], nx, sweep->lam);
        find_hessian(model, sweep);
        copy(sweep->gradient, ny, found[0]);
        pick(sweep->hessian, model->hessian_source, size->hessian_nonzeros, found[1]);
        copy(size->projected ? sweep->V : sweep->x, nx, found[2]);
        pick(sweep->end, model->jacobian_source, size->jacobian_nonzeros, found[3]);
    }
}

/* tables and memory */

static struct sparse read_sparse(struct reader *reader)
{
    struct sparse sparse = {.rows = reader->tables[0] - 1};
    sparse.start = read_table(reader);
    sparse.column = read_table(reader);
    sparse.source = read_table(reader);
    return sparse;
}

static struct curvature read_curvature(struct reader *reader)
{
    struct curvature curvature;
    curvature.variable = read_table(reader);
    curvature.hessian = read_sparse(reader);
    curvature.dependent = read_sparse(reader);
    return curvature;
}

struct model read_model(struct reader *reader)
{
    struct model model;
    model.size = (const struct sizes *)read_table(reader);
    model.column_of = read_table(reader);
    model.acting_state = read_table(reader);
    model.jacobian_source = read_table(reader);
    model.hessian_source = read_table(reader);
    model.A = read_constants(reader, model.size->stages * model.size->stages);
    model.B = read_constants(reader, model.size->stages);
    model.rates_jacobian = read_sparse(reader);
    model.rates_hessian = read_curvature(reader);
    model.projection_jacobian = read_sparse(reader);
    model.projection_hessian = read_curvature(reader);
    model.rates = read_function(reader);
    model.rates_linear = read_function(reader);
    model.rates_curved = read_function(reader);
    model.projection_linear = read_function(reader);
    model.projection_curved = read_function(reader);
    return model;
}

struct sweep allocate_sweep(const struct model *model, struct reader *reader)
{
    const struct sizes *size = model->size;
    const size_t nx = size->nx, nz = nx + size->nu, padded = size->padded, stages = size->steps * size->stages;
    struct sweep sweep = {.end = NULL};
    sweep.y = allocate(reader, nz + 1);
    sweep.x = allocate(reader, nx);
    sweep.dx = allocate(reader, nx * padded);
    sweep.z = allocate(reader, stages * nz);
    sweep.K = allocate(reader, stages * nx);
    sweep.jacobian = allocate(reader, stages * size->rates_nonzeros);
    sweep.S = allocate(reader, stages * nz * padded);
    sweep.V = allocate(reader, nx);
    sweep.dK = allocate(reader, size->stages * nx * padded);
    sweep.nonzero = allocate(reader, size->most_nonzeros);
    sweep.rows = allocate(reader, 2 * nz * padded);
    sweep.lam = allocate(reader, nx);
    sweep.gradient = allocate(reader, nz + 1);
    sweep.w = allocate(reader, padded);
    sweep.zbar = allocate(reader, size->stages * nz);
    sweep.k = allocate(reader, nx);
    sweep.weighted = allocate(reader, nx);
    sweep.hessian = allocate(reader, size->active * padded);
    return sweep;
}
