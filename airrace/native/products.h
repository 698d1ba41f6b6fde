/* Products of small matrices in blasfeo's panels of four rows, see products.c. */
#ifndef AIRRACE_PRODUCTS_H
#define AIRRACE_PRODUCTS_H

#include "lanes.h"

#define gemm_nt VARIANT_NAME(gemm_nt)
#define gemv_n VARIANT_NAME(gemv_n)
#define gemv_t VARIANT_NAME(gemv_t)

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
