/* How others call the functions of several intervals at once: casadi interval after interval, the replay row by row.
 *
 * Before this text stand lanes.h, per function its sizes and patterns, see lane_interface.py, lane_copies.h and
 * library_function.h.
 */

typedef int function_of_lanes(const real **arg, real **res, integer *iw, real *w, int mem);

/* the third argument is what all intervals share */
static int call(
    function_of_lanes *function, const double **arg, double **res, int inputs, const int *size_in, int outputs,
    const int *size_out, real *given, real *found)
{
    const real *a[] = {0, 0, 0, 0};
    real *r[] = {0, 0};
    for (int k = 0; k < inputs; given += size_in[k++]) {
        if (!arg[k]) continue;
        a[k] = given;
        if (k != 2) gather(arg[k], size_in[k], given);
        else
            for (int i = 0; i < size_in[k]; i++) given[i] = all(arg[k][i]);
    }
    real *to = found;
    for (int k = 0; k < outputs; to += size_out[k++])
        if (res[k]) r[k] = to;
    if (function(a, r, 0, 0, 0)) return 1;
    for (int k = 0; k < outputs; found += size_out[k++])
        if (res[k]) scatter(found, size_out[k], res[k]);
    return 0;
}

/* what casadi calls */
#define SEVERAL_AT_ONCE(name, inputs, outputs)                                                                        \
    function_of_lanes name##_of_lanes;                                                                                \
    EXPORT int name(const double **arg, double **res, integer *iw, double *w, int mem)                                \
    {                                                                                                                 \
        real given[name##_NUMBERS_IN + 1], found[name##_NUMBERS_OUT + 1];                                             \
        return call(                                                                                                  \
            name##_of_lanes, arg, res, inputs, name##_SIZE_IN, outputs, name##_SIZE_OUT, given, found);               \
    }                                                                                                                 \
    WHAT_CASADI_ASKS(name, inputs, outputs)

/* values (x, u, p) at many points: rows of x, of u and of the values, and p once */
#define ROW_BY_ROW(name, values)                                                                                      \
    function_of_lanes name##_of_lanes;                                                                                \
    EXPORT int name##_rows(const double *x, const double *u, const double *p, double *out, integer count)             \
    {                                                                                                                 \
        real z[NZ + 1], shared[NP + 1], found[values + 1];                                                            \
        for (int i = 0; i < NP; i++) shared[i] = all(p[i]);                                                           \
        for (integer first = 0; first < count; first += LANES) {                                                      \
            const real *arg[] = {z, z + NX, shared};                                                                  \
            real *res[] = {found};                                                                                    \
            gather_rows(x, NX, first, count, z);                                                                      \
            gather_rows(u, NZ - NX, first, count, z + NX);                                                            \
            if (name##_of_lanes(arg, res, 0, 0, 0)) return 1;                                                         \
            scatter_rows(found, values, first, count, out);                                                           \
        }                                                                                                             \
        return 0;                                                                                                     \
    }
