/* Functions and steps of models at many intervals, LANES in a batch: gathered, evaluated, scattered. */
#include "evaluator.h"

#include "interior_point.h"
#include "riccati.h"
#include "step.h"

static struct reader read_kernel(struct kernel kernel)
{
    return (struct reader){kernel.tables, kernel.code, kernel.constants, (real *)kernel.memory, 0};
}

/* numbers of one interval behind those of another, to the lanes and back */

static void gather(const double *from, int size, real *to)
{
    for (int i = 0; i < size; i++)
        for (int lane = 0; lane < LANES; lane++) to[i][lane] = from[lane * size + i];
}

static void scatter(const real *from, int size, double *to)
{
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < size; i++) to[lane * size + i] = from[i][lane];
}

static void gather_batch(const struct batches *batches, int64_t batch, const int *size, real *const *to)
{
    for (int k = 0; k < ARGUMENTS; k++)
        if (k != SHARED && batches->given[k]) gather(batches->given[k] + batch * LANES * size[k], size[k], to[k]);
}

static void scatter_batch(const struct batches *batches, int64_t batch, int results, const int *size, real *const *from)
{
    for (int k = 0; k < results; k++)
        if (batches->found[k]) scatter(from[k], size[k], batches->found[k] + batch * LANES * size[k]);
}

/* a function that stands for itself */

static int64_t function_memory(struct kernel kernel)
{
    struct reader reader = read_kernel(kernel);
    read_function(&reader);
    return (int64_t)reader.used * LANES;
}

static void evaluate_function(struct kernel kernel, const struct batches *batches, int64_t first, int64_t end)
{
    struct reader reader = read_kernel(kernel);
    const struct function function = read_function(&reader);
    real *given[ARGUMENTS], *found[RESULTS];
    for (int k = 0; k < ARGUMENTS; k++) given[k] = function.number + function.argument[k];
    for (int k = 0; k < RESULTS; k++) found[k] = function.number + function.result[k];
    prepare(&function, batches->given[SHARED]);
    for (int64_t batch = first; batch < end; batch++) {
        gather_batch(batches, batch, function.argument_size, given);
        interpret(function.code, function.number);
        scatter_batch(batches, batch, RESULTS, function.result_size, found);
    }
}

/* the step of a model */

struct exchange {
    int given_size[ARGUMENTS], found_size[STEP_RESULTS];
    real *given[ARGUMENTS], *found[STEP_RESULTS];
};

static struct exchange allocate_exchange(const struct model *model, int order, struct reader *reader)
{
    const struct sizes *size = model->size;
    const int ny = size->nx + size->nu + 1;
    struct exchange exchange = {
        .given_size = {ny, 1, 0, size->nx},
        .found_size = {
            order == 2 ? ny : size->nx,
            order == 0 ? 0 : order == 1 ? size->jacobian_nonzeros : size->hessian_nonzeros,
            order == 2 ? size->nx : 0, order == 2 ? size->jacobian_nonzeros : 0}};
    for (int k = 0; k < ARGUMENTS; k++) exchange.given[k] = allocate(reader, exchange.given_size[k]);
    for (int k = 0; k < STEP_RESULTS; k++) exchange.found[k] = allocate(reader, exchange.found_size[k]);
    return exchange;
}

static int64_t step_memory(struct kernel kernel, int order)
{
    struct reader reader = read_kernel(kernel);
    const struct model model = read_model(&reader);
    allocate_sweep(&model, &reader);
    allocate_exchange(&model, order, &reader);
    return (int64_t)reader.used * LANES;
}

static void evaluate_steps(
    struct kernel kernel, int order, const struct batches *batches, int64_t first, int64_t end)
{
    struct reader reader = read_kernel(kernel);
    const struct model model = read_model(&reader);
    struct sweep sweep = allocate_sweep(&model, &reader);
    const struct exchange exchange = allocate_exchange(&model, order, &reader);
    prepare(&model.rates, batches->given[SHARED]);
    prepare(&model.rates_linear, batches->given[SHARED]);
    prepare(&model.rates_curved, batches->given[SHARED]);
    prepare(&model.projection_linear, NULL);
    prepare(&model.projection_curved, NULL);
    for (int64_t batch = first; batch < end; batch++) {
        gather_batch(batches, batch, exchange.given_size, exchange.given);
        evaluate_step(&model, &sweep, order, (const real *const *)exchange.given, exchange.found);
        scatter_batch(batches, batch, STEP_RESULTS, exchange.found_size, exchange.found);
    }
}

/* points in columns; the lanes beyond the last point repeat it */

static void gather_columns(const double *from, int rows, int64_t first, int64_t count, real *to)
{
    for (int r = 0; r < rows; r++)
        for (int lane = 0; lane < LANES; lane++)
            to[r][lane] = from[r * count + (first + lane < count ? first + lane : count - 1)];
}

static void scatter_columns(const real *from, int rows, int64_t first, int64_t count, double *to)
{
    for (int r = 0; r < rows; r++)
        for (int lane = 0; lane < LANES && first + lane < count; lane++) to[r * count + first + lane] = from[r][lane];
}

static void evaluate_points(
    struct kernel kernel, const double *x, const double *u, const double *p, double *values, int64_t count)
{
    struct reader reader = read_kernel(kernel);
    const struct function function = read_function(&reader);
    const double *given[] = {x, u};
    prepare(&function, p);
    for (int64_t first = 0; first < count; first += LANES) {
        for (int k = 0; k < 2; k++)
            gather_columns(given[k], function.argument_size[k], first, count, function.number + function.argument[k]);
        interpret(function.code, function.number);
        scatter_columns(function.number + function.result[0], function.result_size[0], first, count, values);
    }
}

#define QUOTE(name) #name
#define STRING(name) QUOTE(name)

const struct evaluator VARIANT_NAME(evaluator) = {
    STRING(VARIANT),
    LANES,
    function_memory,
    step_memory,
    evaluate_function,
    evaluate_steps,
    evaluate_points,
    interior_residuals,
    interior_multipliers,
    interior_factorise,
    interior_solve,
    interior_predictor_corrector,
};
