/* What casadi asks about a function of a library: how many matrices go in and come out, their patterns, its memory. */
#define WHAT_CASADI_ASKS(name, inputs, outputs)                                                                       \
    EXPORT void name##_incref(void) {}                                                                                \
    EXPORT void name##_decref(void) {}                                                                                \
    EXPORT integer name##_n_in(void) { return inputs; }                                                               \
    EXPORT integer name##_n_out(void) { return outputs; }                                                             \
    EXPORT const integer *name##_sparsity_in(integer i) { return i < inputs ? name##_IN[i] : 0; }                     \
    EXPORT const integer *name##_sparsity_out(integer i) { return i < outputs ? name##_OUT[i] : 0; }                  \
    EXPORT int name##_work(integer *arg, integer *res, integer *iw, integer *w)                                       \
    {                                                                                                                 \
        if (arg) *arg = inputs;                                                                                       \
        if (res) *res = outputs;                                                                                      \
        if (iw) *iw = 0;                                                                                              \
        if (w) *w = 0;                                                                                                \
        return 0;                                                                                                     \
    }
