"""Elementary functions of symbols and floats alike, twice differentiable where the models use them."""

from collections.abc import Callable

import casadi as ca

from airrace.optimal_control.quantities import Scalar

# casadi overloads these by the type of their argument; a Scalar may be any of them
sqrt: Callable[[Scalar], Scalar] = ca.sqrt
exp: Callable[[Scalar], Scalar] = ca.exp
log: Callable[[Scalar], Scalar] = ca.log
sin: Callable[[Scalar], Scalar] = ca.sin
cos: Callable[[Scalar], Scalar] = ca.cos
atan2: Callable[[Scalar, Scalar], Scalar] = ca.atan2

# not differentiable where their arguments are equal, so only for expressions that no solver sees
minimum: Callable[[Scalar, Scalar], Scalar] = ca.fmin
maximum: Callable[[Scalar, Scalar], Scalar] = ca.fmax


def power(x: Scalar, exponent: Scalar) -> Scalar:
    """Return `x^exponent` of a positive number, as `exp(exponent log x)`: its derivatives need no further powers."""
    return exp(exponent * log(x))


def smooth_maximum(a: Scalar, b: Scalar, width: Scalar) -> Scalar:
    """Return a smooth upper bound of `max(a, b)`, `(a + b + sqrt((a - b)^2 + width^2)) / 2`.

    It exceeds the maximum by `width / 2` where both are equal, and by less away from there.
    """
    difference = a - b
    return 0.5 * (a + b + sqrt(difference * difference + width * width))


def smooth_clip(x: Scalar, lower: Scalar, upper: Scalar, width: Scalar) -> Scalar:
    """Return `x` rounded off at two limits that it never reaches.

    It rises everywhere, with a slope of nearly one between the limits.

    `(lower + upper)/2 + [sqrt((x - lower)^2 + width^2) - sqrt((x - upper)^2 + width^2)]/2`
    """
    above, below = x - lower, x - upper
    return 0.5 * (lower + upper + sqrt(above * above + width * width) - sqrt(below * below + width * width))
