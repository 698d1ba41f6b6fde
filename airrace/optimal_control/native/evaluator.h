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

struct interior_program;
struct interior_corrections;

/* Tables as interpreter.py and runge_kutta.py write them, and working memory, 64-byte aligned. */
struct kernel {
    const int *tables;
    const void *code;
    const double *constants;
    double *memory;
};

/* Arguments (y, own, shared[, lam]) and results, interval after interval, but for what is shared; null where absent. The
 * Hessian of a step leaves (gradient, Hessian) and, from the same sweep, the step's end and its Jacobian. */
struct batches {
    const double *given[4];
    double *found[4];
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
    /* see interior_point.h */
    void (*interior_residuals)(
        const struct interior_program *program, const double *point, const double *gradient, const double *constraints,
        double *residuals, double *measures);
    void (*interior_multipliers)(const struct interior_program *program, const double *point, double *multipliers);
    int (*interior_factorise)(const struct interior_program *program, const double *point, double damping);
    void (*interior_solve)(
        const struct interior_program *program, const double *point, const double *residuals, double *step);
    void (*interior_predictor_corrector)(
        const struct interior_program *program, const struct interior_corrections *corrections, const double *point,
        const double *residuals, double barrier_min, double *step, double *lengths);
};

/* The variant of a name, or the widest that this processor executes; null where it does not execute that variant. */
EXPORT const struct evaluator *airrace_evaluator(const char *name);

/* The names of the interpreter's operations in their order, each behind a space. */
EXPORT const char *airrace_operations(void);

#endif
