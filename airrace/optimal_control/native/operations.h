/* The elementary operations of casadi's SX functions, by casadi's names (OP_...), each with its expression.
 *
 * ON_VECTORS: in vectors x and y. BY_LANE: in numbers a and b of one lane, by functions of the C library.
 * The numbers of the operations are their places in both lists, one behind the other; interpreter.py reads the names.
 */
#ifndef AIRRACE_OPERATIONS_H
#define AIRRACE_OPERATIONS_H

#define ON_VECTORS(EACH)                                                                                              \
    EACH(ASSIGN, x)                                                                                                   \
    EACH(ADD, x + y)                                                                                                  \
    EACH(SUB, x - y)                                                                                                  \
    EACH(MUL, x * y)                                                                                                  \
    EACH(DIV, x / y)                                                                                                  \
    EACH(NEG, -x)                                                                                                     \
    EACH(SQ, x * x)                                                                                                   \
    EACH(TWICE, 2.0 * x)                                                                                              \
    EACH(INV, 1.0 / x)

#define BY_LANE(EACH)                                                                                                 \
    EACH(EXP, exp(a))                                                                                                 \
    EACH(LOG, log(a))                                                                                                 \
    EACH(POW, pow(a, b))                                                                                              \
    EACH(CONSTPOW, pow(a, b))                                                                                         \
    EACH(SQRT, sqrt(a))                                                                                               \
    EACH(SIN, sin(a))                                                                                                 \
    EACH(COS, cos(a))                                                                                                 \
    EACH(TAN, tan(a))                                                                                                 \
    EACH(ASIN, asin(a))                                                                                               \
    EACH(ACOS, acos(a))                                                                                               \
    EACH(ATAN, atan(a))                                                                                               \
    EACH(LT, a < b)                                                                                                   \
    EACH(LE, a <= b)                                                                                                  \
    EACH(EQ, a == b)                                                                                                  \
    EACH(NE, a != b)                                                                                                  \
    EACH(NOT, !a)                                                                                                     \
    EACH(AND, a && b)                                                                                                 \
    EACH(OR, a || b)                                                                                                  \
    EACH(FLOOR, floor(a))                                                                                             \
    EACH(CEIL, ceil(a))                                                                                               \
    EACH(FMOD, fmod(a, b))                                                                                            \
    EACH(FABS, fabs(a))                                                                                               \
    EACH(SIGN, a < 0 ? -1 : a > 0 ? 1 : a)                                                                            \
    EACH(COPYSIGN, copysign(a, b))                                                                                    \
    EACH(IF_ELSE_ZERO, a ? b : 0)                                                                                     \
    EACH(FMIN, fmin(a, b))                                                                                            \
    EACH(FMAX, fmax(a, b))                                                                                            \
    EACH(SINH, sinh(a))                                                                                               \
    EACH(COSH, cosh(a))                                                                                               \
    EACH(TANH, tanh(a))                                                                                               \
    EACH(ASINH, asinh(a))                                                                                             \
    EACH(ACOSH, acosh(a))                                                                                             \
    EACH(ATANH, atanh(a))                                                                                             \
    EACH(ATAN2, atan2(a, b))                                                                                          \
    EACH(LOG1P, log1p(a))                                                                                             \
    EACH(EXPM1, expm1(a))                                                                                             \
    EACH(HYPOT, hypot(a, b))

#endif
