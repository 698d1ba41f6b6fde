/* The step of a compiled model and its derivatives as functions of its library.
 *
 * Before this text stand model_tables.c and the tables of the model, see step_kernel.py. On lanes the functions are
 * called by the library's interface, see lane_interface.c.
 */

#ifdef LANES
#define KERNEL(name) int name##_of_lanes
#else
#define KERNEL(name) EXPORT int name
#endif

static int evaluated(int order, const real **arg, real **res)
{
    struct reader from = {TABLES, 0, NUMBERS, 0, 0};
    struct model model = read_model(&from);
    make_flight(&model, &from);
    real memory[from.memory - (real *)0];
    from.memory = memory;
    struct flight flight = make_flight(&model, &from);
    model.rates.shared = model.rates_linear.shared = model.rates_curved.shared = arg[2];
    const real *given[] = {arg[0], arg[1], 0, order == 2 ? arg[3] : 0};
    real *found[] = {res[0], order ? res[1] : 0};
    evaluate_step(&model, &flight, order, given, found);
    return 0;
}

KERNEL(step)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    return evaluated(0, arg, res);
}

KERNEL(step_jacobian)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    return evaluated(1, arg, res);
}

KERNEL(step_hessian)(const real **arg, real **res, integer *iw, real *w, int mem)
{
    return evaluated(2, arg, res);
}

/* what casadi asks, see library_function.h; the library's interface answers for several intervals */

#ifndef LANES
static const integer *const step_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P};
static const integer *const step_jacobian_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P};
static const integer *const step_hessian_IN[] = {PATTERN_Y, PATTERN_SCALAR, PATTERN_P, PATTERN_X};
static const integer *const step_OUT[] = {PATTERN_X};
static const integer *const step_jacobian_OUT[] = {PATTERN_X, PATTERN_JACOBIAN};
static const integer *const step_hessian_OUT[] = {PATTERN_Y, PATTERN_HESSIAN};
WHAT_CASADI_ASKS(step, 3, 1)
WHAT_CASADI_ASKS(step_jacobian, 3, 2)
WHAT_CASADI_ASKS(step_hessian, 4, 2)
#endif
