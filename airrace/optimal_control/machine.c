/* One machine for all models: their functions and derivatives at many intervals, from tables that machine.py makes.
 *
 * Before this text stand interpreter.c, step_driver.c, model_tables.c and lane_copies.h.
 */

/* Intervals from batch `first` to batch `end`, LANES in a batch: arguments (y, own, shared[, lam]) and results,
 * interval after interval, but for what they share. */
struct calls {
    const double *given[ARGUMENTS];
    double *found[RESULTS];
};

static void gather_all(const struct calls *calls, integer batch, const int *size, real *const *to)
{
    for (int k = 0; k < ARGUMENTS; k++)
        if (k != SHARED && calls->given[k]) gather(calls->given[k] + batch * LANES * size[k], size[k], to[k]);
}

static void scatter_all(const struct calls *calls, integer batch, const int *size, real *const *from)
{
    for (int k = 0; k < RESULTS; k++)
        if (calls->found[k]) scatter(from[k], size[k], calls->found[k] + batch * LANES * size[k]);
}

/* the step of a model: its values, Jacobian or Hessian (order 0, 1, 2) */

/* the arguments and results of one batch */
struct exchange {
    int given_size[ARGUMENTS], found_size[RESULTS];
    real *given[ARGUMENTS], *found[RESULTS];
};

static struct exchange exchange_of(const struct model *model, int order, struct reader *from)
{
    struct exchange of = {
        .given_size = {NY, 1, 0, NX},
        .found_size = {order == 2 ? NY : NX, order == 2 ? HESSIAN_NONZEROS : JACOBIAN_NONZEROS}};
    for (int k = 0; k < ARGUMENTS; k++) of.given[k] = room(from, of.given_size[k]);
    for (int k = 0; k < RESULTS; k++) of.found[k] = room(from, of.found_size[k]);
    return of;
}

/* how many vectors of memory are asked for */
EXPORT integer step_room(struct reader from, int order)
{
    const real *first = from.memory;
    const struct model model = read_model(&from);
    make_flight(&model, &from);
    exchange_of(&model, order, &from);
    return from.memory - first;
}

EXPORT void step_calls(struct reader from, int order, const struct calls *calls, integer first, integer end)
{
    const struct model model = read_model(&from);
    struct flight flight = make_flight(&model, &from);
    const struct exchange of = exchange_of(&model, order, &from);
    begin(&model.rates, calls->given[SHARED]);
    begin(&model.rates_linear, calls->given[SHARED]);
    begin(&model.rates_curved, calls->given[SHARED]);
    begin(&model.projection_linear, 0);
    begin(&model.projection_curved, 0);
    for (integer batch = first; batch < end; batch++) {
        gather_all(calls, batch, of.given_size, of.given);
        evaluate_step(&model, &flight, order, (const real *const *)of.given, of.found);
        scatter_all(calls, batch, of.found_size, of.found);
    }
}

/* a single function */

EXPORT integer function_room(struct reader from)
{
    return function(&from).numbers;
}

EXPORT void function_calls(struct reader from, const struct calls *calls, integer first, integer end)
{
    const struct function of = function(&from);
    real *given[ARGUMENTS], *found[RESULTS];
    for (int k = 0; k < ARGUMENTS; k++) given[k] = of.number + of.argument[k];
    for (int k = 0; k < RESULTS; k++) found[k] = of.number + of.result[k];
    begin(&of, calls->given[SHARED]);
    for (integer batch = first; batch < end; batch++) {
        gather_all(calls, batch, of.argument_size, given);
        interpret(of.code, of.number);
        scatter_all(calls, batch, of.result_size, found);
    }
}

/* values (x, u, p) at many points: rows of x, of u and of the values, a point per column, and p once */
EXPORT void function_rows(
    struct reader from, const double *x, const double *u, const double *p, double *out, integer count)
{
    const struct function of = function(&from);
    const double *given[] = {x, u};
    begin(&of, p);
    for (integer first = 0; first < count; first += LANES) {
        for (int k = 0; k < 2; k++)
            gather_rows(given[k], of.argument_size[k], first, count, of.number + of.argument[k]);
        interpret(of.code, of.number);
        scatter_rows(of.number + of.result[0], of.result_size[0], first, count, out);
    }
}
