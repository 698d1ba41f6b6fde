/* The linear algebra of solvers: the Riccati recursions of riccati.c, see there for the arguments, and products. */
#ifndef AIRRACE_LINEAR_ALGEBRA_H
#define AIRRACE_LINEAR_ALGEBRA_H

#include "lanes.h"

#define riccati_factorise VARIANT_NAME(riccati_factorise)
#define riccati_solve VARIANT_NAME(riccati_solve)
#define riccati_rows VARIANT_NAME(riccati_rows)
#define riccati_rows_transposed VARIANT_NAME(riccati_rows_transposed)
#define null_space_riccati VARIANT_NAME(null_space_riccati)
#define gemm_nt VARIANT_NAME(gemm_nt)
#define gemv_n VARIANT_NAME(gemv_n)
#define gemv_t VARIANT_NAME(gemv_t)

int riccati_factorise(
    int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
    const double *row_weights, const double *weights, double *factors, double *first);

void riccati_solve(
    int stages, int m, const int *sizes, const double *F, const double *factors, const double *first, const double *r,
    const double *s, double *lead, double *costs, double *step, double *y);

void riccati_rows(int stages, const int *sizes, const int *rows, const double *C, const double *z, double *values);

void riccati_rows_transposed(
    int stages, const int *sizes, const int *rows, const double *C, const double *values, double *z);

int null_space_riccati(
    int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
    const unsigned char *kept, const double *weights, double shift, double *gains, double *costs, double *ahead,
    int *free);

/* Products of small matrices in blasfeo's panels of four rows, products.c. */

/* D = beta C + alpha A B', with panels A and B of kmax columns and 4 x 4 matrices C and D */
void gemm_nt(
    int kmax, const double *alpha, const double *A, const double *B, const double *beta, const double *C, double *D);

/* z = beta y + alpha A x, with a panel A of kmax columns */
void gemv_n(
    int kmax, const double *alpha, const double *A, const double *x, const double *beta, const double *y, double *z);

/* z = beta y + alpha A' x, with four columns and kmax rows of A, the first of which is row `offset` of its panel; a
 * panel has `width` columns */
void gemv_t(
    int kmax, const double *alpha, int offset, const double *A, int width, const double *x, const double *beta,
    const double *y, double *z);

#endif
