"""The counters of a roll: the angle rolled and the height gained since it began.

Two states count along with the flight; two controls wind them back to zero before a roll begins, and rest during it:

    Phi' = p_Kbar + Phi_reset,     gain' = -z' + gain_reset

Only the flight through a course with a roll carries them; any model that knows its roll rate can.
"""

from airrace.frames import Scalar
from airrace.quantities import Interval, T, Vector, quantity, vector


@vector
class RollCounter(Vector[T]):
    """The counted angle and height."""

    Phi: T = quantity("rad", scale=3.0, text="angle rolled since the roll began")
    gain: T = quantity("m", scale=100.0, text="height gained since the roll began")


@vector
class RollReset(Vector[T]):
    """The rates at which the counters are wound back."""

    Phi_reset: T = quantity("rad/s", scale=10.0, text="winding back of the angle rolled")
    gain_reset: T = quantity("m/s", scale=100.0, text="winding back of the height gained")


COUNTING = {name: Interval.exactly(0.0) for name in RollReset.names()}
"""The bounds of the controls in the phase in which a roll is flown: nothing is wound back."""

FROM_ZERO = {name: Interval.exactly(0.0) for name in RollCounter.names()}
"""The bounds of the counters where that phase begins: both are zero."""


def counter_rates(p_Kbar: Scalar, z_dot: Scalar, reset: RollReset[Scalar]) -> RollCounter[Scalar]:
    """Return the time derivatives of the counters.

    Args:
        p_Kbar: roll rate about the velocity, rad/s.
        z_dot: rate of descent, m/s.
        reset: see `RollReset`.
    """
    return RollCounter(Phi=p_Kbar + reset.Phi_reset, gain=reset.gain_reset - z_dot)
