"""The outer loop, from load factors and roll rate to the flight path, which all fidelities share, and its inverse.

With `R = R_OKbar`, the specific force `g0 (n_x, n_y, -n_z)` and the rates of Kbar, all in Kbar:

    r_dot_O = V_K R e_x                         q_Kbar = g0 (n_z - R33) / V_K
    V_K_dot = g0 (n_x + R31)                    r_Kbar = g0 (n_y + R32) / V_K
    q_dot   = 1/2 q o (0, p_Kbar, q_Kbar, r_Kbar)
"""

import casadi as ca

from airrace.model.environment import g0
from airrace.model.frames import Matrix, product, quaternion_rates, rotation
from airrace.optimal_control.quantities import Scalar, T, Vector, quantity, vector
from airrace.optimal_control.system import System, column, named_symbols


@vector
class FlightPathState(Vector[T]):
    """The position, velocity and attitude of the flight path: the first eight states of equation (11)."""

    x: T = quantity("m", scale=100.0, text="north of the origin")
    y: T = quantity("m", scale=100.0, text="east of the origin")
    z: T = quantity("m", scale=100.0, text="below the origin")
    V_K: T = quantity("m/s", scale=50.0, text="kinematic speed")
    q0: T = quantity("1", text="attitude of the flight-path frame Kbar, scalar part")
    q1: T = quantity("1", text="attitude of the flight-path frame Kbar, north part")
    q2: T = quantity("1", text="attitude of the flight-path frame Kbar, east part")
    q3: T = quantity("1", text="attitude of the flight-path frame Kbar, down part")

    @property
    def q(self) -> tuple[T, T, T, T]:
        """The quaternion of `R_OKbar`, scalar first."""
        return self.q0, self.q1, self.q2, self.q3


@vector
class PoweredState(FlightPathState[T]):
    """The flight path and the throttle, which every model has."""

    delta_T: T = quantity("1", lower=0.0, upper=1.0, text="throttle")


def turn_rates(V_K: Scalar, R: Matrix, *, n_y: Scalar, n_z: Scalar) -> tuple[Scalar, Scalar]:
    """Return `(q_Kbar, r_Kbar)`, rad/s: how fast load factors (g) turn the flight path at the speed `V_K` (m/s)."""
    return g0 * (n_z - R[2][2]) / V_K, g0 * (n_y + R[2][1]) / V_K


def flight_path_rates(
    state: FlightPathState[Scalar], R: Matrix, *, n_x: Scalar, n_y: Scalar, n_z: Scalar, p_Kbar: Scalar
) -> FlightPathState[Scalar]:
    """Return the time derivatives of the flight path.

    Args:
        state: position, speed and attitude.
        R: `R_OKbar` of that attitude.
        n_x, n_y, n_z: load factors in Kbar, g; `n_z = 1` in level flight.
        p_Kbar: roll rate about the velocity, rad/s.
    """
    e_N, e_E, e_D = R[0][0], R[1][0], R[2][0]
    q_Kbar, r_Kbar = turn_rates(state.V_K, R, n_y=n_y, n_z=n_z)
    q0_dot, q1_dot, q2_dot, q3_dot = quaternion_rates(state.q, p_Kbar, q_Kbar, r_Kbar)
    return FlightPathState(
        x=state.V_K * e_N,
        y=state.V_K * e_E,
        z=state.V_K * e_D,
        V_K=g0 * (n_x + e_D),
        q0=q0_dot,
        q1=q1_dot,
        q2=q2_dot,
        q3=q3_dot,
    )


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
    _, p_Kbar, q_Kbar, r_Kbar = (twice * component for component in product((q0, -q1, -q2, -q3), rates.q))
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
