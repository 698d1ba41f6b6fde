/* The products of products.c under blasfeo's names: Linux's dynamic linker takes the first function of a name that it
 * finds, so blasfeo calls these once this library is loaded for all others. */
#include "evaluator.h"

static const struct evaluator *chosen;

EXPORT void products_begin(const struct evaluator *evaluator)
{
    chosen = evaluator;
}

EXPORT void kernel_dgemm_nt_4x4_lib4(
    int kmax, const double *alpha, const double *A, const double *B, const double *beta, const double *C, double *D)
{
    chosen->gemm_nt(kmax, alpha, A, B, beta, C, D);
}

EXPORT void kernel_dgemv_n_4_lib4(
    int kmax, const double *alpha, const double *A, const double *x, const double *beta, const double *y, double *z)
{
    chosen->gemv_n(kmax, alpha, A, x, beta, y, z);
}

EXPORT void kernel_dgemv_t_4_lib4(
    int kmax, const double *alpha, int offset, const double *A, int width, const double *x, const double *beta,
    const double *y, double *z)
{
    chosen->gemv_t(kmax, alpha, offset, A, width, x, beta, y, z);
}
