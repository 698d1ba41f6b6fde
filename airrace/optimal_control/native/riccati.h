/* The Riccati recursions of riccati.c, see there for the arguments. */
#ifndef AIRRACE_RICCATI_H
#define AIRRACE_RICCATI_H

#include "lanes.h"

#define riccati_factorise VARIANT_NAME(riccati_factorise)
#define riccati_solve VARIANT_NAME(riccati_solve)
#define riccati_rows VARIANT_NAME(riccati_rows)
#define riccati_rows_transposed VARIANT_NAME(riccati_rows_transposed)

int riccati_factorise(
    int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
    const double *row_weights, const double *weights, double *factors, double *first);

void riccati_solve(
    int stages, int m, const int *sizes, const double *F, const double *factors, const double *first, const double *r,
    const double *s, double *feedforward, double *cost_gradients, double *step, double *y);

void riccati_rows(int stages, const int *sizes, const int *rows, const double *C, const double *z, double *values);

void riccati_rows_transposed(
    int stages, const int *sizes, const int *rows, const double *C, const double *values, double *z);

#endif
