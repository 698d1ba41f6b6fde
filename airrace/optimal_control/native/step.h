/* The step of one shooting interval with its Jacobian and Hessian, composed of those of f alone, for any model. */
#ifndef AIRRACE_STEP_H
#define AIRRACE_STEP_H

#include "interpreter.h"

#define read_model VARIANT_NAME(read_model)
#define allocate_sweep VARIANT_NAME(allocate_sweep)
#define evaluate_step VARIANT_NAME(evaluate_step)

/* Row-compressed pattern: entry e of row r is nonzero[source[e]] in column[e], start[r] <= e < start[r + 1]. */
struct sparse {
    int rows;
    const int *start, *column, *source;
};

/* Second derivatives: of which variables, their pattern among those, and by column of y which of them depend on it. */
struct curvature {
    const int *variable;
    struct sparse hessian, dependent;
};

/* In the order of the table that runge_kutta.py writes; `active`: columns of y that anything but its own state depends
 * on, `padded`: a multiple of GROUP, the length of rows of sensitivities, `acting`: states that f depends on. */
struct sizes {
    int nx, nu, np, stages, steps, active, padded, acting, projected;
    int jacobian_nonzeros, hessian_nonzeros, rates_nonzeros, most_nonzeros;
};

struct model {
    const struct sizes *size;
    const int *column_of, *acting_state, *jacobian_source, *hessian_source;
    const double *A, *B; /* of the Runge-Kutta scheme */
    struct sparse rates_jacobian, projection_jacobian;
    struct curvature rates_hessian, projection_hessian;
    struct function rates, rates_linear, rates_curved, projection_linear, projection_curved;
};

/* What a sweep through an interval leaves behind. Of every stage of every step: z, K, jacobian, S. */
struct sweep {
    real g, h, *y, *x, *dx;              /* x: the end, before the projection; dx: its sensitivity */
    real *z, *K, *jacobian, *S;          /* of all stages */
    real *V, *dK, *nonzero, *end, *rows; /* dK: of the stages of one step; rows: twice nz, for one product */
    real *lam, *gradient, *w, *zbar, *k, *weighted, *hessian;
};

struct model read_model(struct reader *reader);

struct sweep allocate_sweep(const struct model *model, struct reader *reader);

/* Of given (y, phi, -, lam): the end (order 0), the end and its Jacobian (1), or gradient and Hessian of lam . x+ and the
 * end and its Jacobian (2). */
enum { STEP_RESULTS = 4 };

void evaluate_step(
    const struct model *model, struct sweep *sweep, int order, const real *const given[ARGUMENTS],
    real *const found[STEP_RESULTS]);

#endif
