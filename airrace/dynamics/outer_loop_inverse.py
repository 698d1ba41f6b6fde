"""The inverse of the outer loop: load factors and roll rate from the motion that they make.

All models share the outer loop, so their rates tell load factors and roll rate of any of them. With `R = R_OKbar`:

    (0, p_Kbar, q_Kbar, r_Kbar) = 2 q* o q_dot / |q|^2
    n_x = V_K_dot / g0 - R31      n_y = r_Kbar V_K / g0 - R32      n_z = q_Kbar V_K / g0 + R33
"""

import casadi as ca

from airrace.dynamics.flight_model import column, named_symbols
from airrace.dynamics.outer_loop import FlightPathState
from airrace.environment.atmosphere import g0
from airrace.frames import Scalar, product, rotation
from airrace.quantities import T, Vector, quantity, vector
from airrace.system import System


@vector
class LoadFactors(Vector[T]):
    """The specific force `g0 (n_x, n_y, -n_z)`, as load factors in g, and the roll rate, in Kbar."""

    n_x: T = quantity("1", text="load factor along the velocity")
    n_y: T = quantity("1", text="lateral load factor, to the right")
    n_z: T = quantity("1", scale=5.0, text="load factor, 1 in level flight")
    p_Kbar: T = quantity("rad/s", scale=3.0, text="roll rate about the velocity")


def load_factors_of_motion(state: FlightPathState[Scalar], rates: FlightPathState[Scalar]) -> LoadFactors[Scalar]:
    """Return the load factors and the roll rate that make the flight path change at `rates`."""
    R = rotation(state.q)
    q0, q1, q2, q3 = state.q
    twice = 2.0 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    _, p_Kbar, q_Kbar, r_Kbar = (twice * one for one in product((q0, -q1, -q2, -q3), rates.q))
    return LoadFactors(
        n_x=rates.V_K / g0 - R[2][0],
        n_y=r_Kbar * state.V_K / g0 - R[2][1],
        n_z=q_Kbar * state.V_K / g0 + R[2][2],
        p_Kbar=p_Kbar,
    )


def load_factors(system: System) -> ca.Function:
    """Return the SX function (x, u, p) -> (n_x, n_y, n_z, p_Kbar) of a flight model's system.

    The arguments have the shapes (n_x,), (n_u,), (n_p,); load factors are in g, the roll rate in rad/s.

    Args:
        system: its states begin with those of the flight path.
    """
    x, u, p = (named_symbols(declared) for declared in (system.states, system.controls, system.parameters))
    arguments = [column(symbols.values()) for symbols in (x, u, p)]
    rates = FlightPathState[Scalar].split(system.rates(*arguments))
    state = FlightPathState[Scalar](**{name: x[name] for name in FlightPathState.names()})
    values = load_factors_of_motion(state, rates)
    return ca.Function("load_factors", arguments, [column(values.join())], {"cse": True})
