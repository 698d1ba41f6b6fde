/* The steps of the primal-dual interior point method of interior_point.py on a program of stages.
 *
 * A point, a step and residuals are one array each: (w, y, e, s, z), with w the unknowns, y the multipliers of the gaps,
 * e those of the equalities, s the slacks of the one-sided bounds and z their multipliers; residuals end with s. */
#ifndef AIRRACE_INTERIOR_POINT_H
#define AIRRACE_INTERIOR_POINT_H

#include <stdint.h>

#include "lanes.h"

#define interior_residuals VARIANT_NAME(interior_residuals)
#define interior_multipliers VARIANT_NAME(interior_multipliers)
#define interior_factorise VARIANT_NAME(interior_factorise)
#define interior_solve VARIANT_NAME(interior_solve)
#define interior_predictor_corrector VARIANT_NAME(interior_predictor_corrector)

/* In the order of `_ProgramArrays` in bounded_program.py. Bounded are (rows, unknowns), numbered one behind the other. */
struct interior_program {
    int stages, states, unknowns, gaps, rows, equalities, inequalities, constraints;
    const int *sizes, *row_counts;               /* of each stage */
    const double *hessian, *dynamics, *gradients; /* of the stages; gradients of the rows */
    const int64_t *gap_index, *row_index;        /* among the constraints */
    const int64_t *equality;                     /* places of equalities */
    const double *jump, *target;                 /* values of gaps and of equalities */
    const int64_t *inequality;                   /* places of one-sided bounds */
    const double *sign, *bound;                  /* 1 where the bound is a lower one, -1 where an upper one */
    double equality_weight;
    double *factors, *first, *feedforward, *cost_gradients;  /* of the recursion */
    double *values, *multipliers, *changes, *weights;        /* numbers of (rows, unknowns) */
    double *right_hand, *predicted, *correction, *candidate; /* a stationarity; points */
};

/* What Gondzio's corrections may do, `StepParameters` in bounded_program.py. */
struct interior_corrections {
    int count;
    double gain, gain_min, length_enough, spread, boundary_fraction;
};

/* The measures of a point: largest violations of the gaps, equalities and slacks (primal), of stationarity, largest
 * product of a multiplier with the room that the program leaves it, largest, least and mean product of slack and
 * multiplier, mean sizes of the multipliers of constraints and of simple bounds, and the sum of all primal violations. */
enum {
    PRIMAL, STATIONARITY, COMPLEMENTARITY, LARGEST_PRODUCT, LEAST_PRODUCT, MEAN_PRODUCT, CONSTRAINT_MULTIPLIER,
    BOUND_MULTIPLIER, INFEASIBILITY
};

/* Residuals of a point where the gradient of the Lagrangian without its simple bounds, and the constraints, are known. */
void interior_residuals(
    const struct interior_program *program, const double *point, const double *gradient, const double *constraints,
    double *residuals, double *measures);

/* The multipliers of the constraints at a point. */
void interior_multipliers(const struct interior_program *program, const double *point, double *multipliers);

/* Factorise the matrix of a step from a point, with a number added to its diagonal; returns how many pivots are not
 * positive: 0 where the step leads to a minimum. Without slacks to weigh the bounds (`point` NULL) the diagonal alone. */
int interior_factorise(const struct interior_program *program, const double *point, double damping);

/* The step after which the linear conditions hold, with the matrix that was factorised. The products of slack and
 * multiplier change by what lies in the place of the step's z; without residuals (NULL) those are zero. */
void interior_solve(
    const struct interior_program *program, const double *point, const double *residuals, double *step);

/* A step by Mehrotra's predictor and corrector with Gondzio's corrections, and its primal and dual lengths. */
void interior_predictor_corrector(
    const struct interior_program *program, const struct interior_corrections *corrections, const double *point,
    const double *residuals, double barrier_min, double *step, double *lengths);

#endif
