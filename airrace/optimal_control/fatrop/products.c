/* The product of small matrices in which fatrop's factorisation spends its time, four rows at once.
 *
 * blasfeo keeps a matrix in panels of four rows, column after column. Its own function for D = beta C + alpha A B', with
 * panels A and B of kmax columns and 4 x 4 matrices C and D, is written for single numbers in the library that casadi
 * brings along. This one holds a column of the result in a vector. It adds in the same order, and no product is fused
 * with a sum, so it has the same bits.
 */

typedef double column __attribute__((vector_size(32), aligned(8)));

static inline column all(double number)
{
    return (column){number, number, number, number};
}

static inline column at(const double *place)
{
    return *(const column *)place;
}

void kernel_dgemm_nt_4x4_lib4(int kmax, const double *alpha, const double *A, const double *B, const double *beta,
                              const double *C, double *D)
{
    column sums[4] = {all(0.0), all(0.0), all(0.0), all(0.0)};
    for (int k = 0; k < kmax; k++)
        for (int j = 0; j < 4; j++) sums[j] += at(A + 4 * k) * all(B[4 * k + j]);
    for (int j = 0; j < 4; j++) *(column *)(D + 4 * j) = all(*beta) * at(C + 4 * j) + all(*alpha) * sums[j];
}
