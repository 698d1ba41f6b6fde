/* What every variant of the library offers: functions and steps of models at many intervals. */
#ifndef AIRRACE_EVALUATOR_H
#define AIRRACE_EVALUATOR_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Tables as interpreter.py and runge_kutta.py write them, and working memory, 64-byte aligned. */
struct kernel {
    const int *tables;
    const void *code;
    const double *constants;
    double *memory;
};

/* Arguments (y, own, shared[, lam]) and results, interval after interval, but for what is shared; null where absent. */
struct batches {
    const double *given[4];
    double *found[2];
};

/* Names, types and order as in library.py. Batches hold `lanes` intervals each; `order` is that of the derivatives. */
struct evaluator {
    const char *name;
    int lanes;
    /* numbers of working memory */
    int64_t (*function_memory)(struct kernel kernel);
    int64_t (*step_memory)(struct kernel kernel, int order);
    /* batches from `first` to `end` */
    void (*evaluate_function)(struct kernel kernel, const struct batches *batches, int64_t first, int64_t end);
    void (*evaluate_step)(struct kernel kernel, int order, const struct batches *batches, int64_t first, int64_t end);
    /* values (x, u, p) at `count` points: rows of x, of u and of the values, a point per column, and p once */
    void (*evaluate_points)(
        struct kernel kernel, const double *x, const double *u, const double *p, double *values, int64_t count);
    /* see riccati.c */
    int (*riccati_factorise)(
        int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
        const double *row_weights, const double *weights, double *factors, double *first);
    void (*riccati_solve)(
        int stages, int m, const int *sizes, const double *F, const double *factors, const double *first,
        const double *r, const double *s, double *lead, double *costs, double *step, double *y);
    void (*riccati_rows)(
        int stages, const int *sizes, const int *rows, const double *C, const double *z, double *values);
    void (*riccati_rows_transposed)(
        int stages, const int *sizes, const int *rows, const double *C, const double *values, double *z);
    /* see linear_algebra.h */
    void (*gemm_nt)(
        int kmax, const double *alpha, const double *A, const double *B, const double *beta, const double *C,
        double *D);
    void (*gemv_n)(
        int kmax, const double *alpha, const double *A, const double *x, const double *beta, const double *y,
        double *z);
    void (*gemv_t)(
        int kmax, const double *alpha, int offset, const double *A, int width, const double *x, const double *beta,
        const double *y, double *z);
    int (*null_space_riccati)(
        int stages, int m, const int *sizes, const double *H, const double *F, const int *rows, const double *C,
        const unsigned char *kept, const double *weights, double shift, double *gains, double *costs, double *ahead,
        int *free);
};

/* The variant of a name, or the widest that this processor executes; null where it does not execute that variant. */
EXPORT const struct evaluator *airrace_evaluator(const char *name);

/* The names of the interpreter's operations in their order, each behind a space. */
EXPORT const char *airrace_operations(void);

#endif
