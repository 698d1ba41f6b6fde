/* The functions of a model as a compiler made them, in the place of interpreter.c.
 *
 * Before this text stand lanes.h or one_lane.h, how much room the functions ask for, see step_kernel.py, and tables.h.
 */

typedef int generated(const real **arg, real **res, integer *iw, real *w, int mem);
generated RATES_ALONE, rates_linear, rates_curved, projection_linear, projection_curved;

/* A function of up to four arguments, of which the third is what all intervals share, and up to two results. */
enum { ARGUMENTS = 4, SHARED = 2, RESULTS = 2 };
struct function {
    generated *evaluate;
    const real *shared;
};

/* the next of them, in the order of the model */
static struct function function(struct reader *from)
{
#if PROJECTED_END
    static generated *const functions[] = {
        RATES_ALONE, rates_linear, rates_curved, projection_linear, projection_curved};
#else
    static generated *const functions[] = {RATES_ALONE, rates_linear, rates_curved, 0, 0};
#endif
    return (struct function){functions[from->functions++], 0};
}

static void call(const struct function *function, const real *const given[ARGUMENTS], real *const found[RESULTS])
{
    const real *shared = function->shared ? function->shared : given[SHARED];
    const real *arg[ROOM_FOR_ARGUMENTS] = {given[0], given[1], shared, given[3]};
    real *res[ROOM_FOR_RESULTS] = {found[0], found[1]};
    integer iw[ROOM_FOR_INTEGERS];
    real w[ROOM_FOR_REALS];
    function->evaluate(arg, res, iw, w, 0); /* straight-line code, which cannot fail */
}
