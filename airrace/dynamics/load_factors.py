"""The lift, the sideslip and the axial load factor that belong to the load factors of models without angles.

With `a` the direction of `V_A` in Kbar, force balance gives the axial load factor; in wind, lift has a part along V_K:

    C_L = m g0 n_z / (qbar S sqrt(1 - a_z^2))        beta_A = m g0 n_y / (qbar S C_Y,trim)
    n_x = [(T - D) / (m g0) - a_y n_y + a_z n_z] / a_x
"""

from airrace.dynamics.aerodynamics import Airflow, drag_coefficient
from airrace.dynamics.aircraft_parameters import AircraftParameters
from airrace.dynamics.propulsion import thrust
from airrace.environment.atmosphere import g0
from airrace.environment.elementary import sqrt
from airrace.frames import Scalar
from airrace.quantities import T, Vector, quantity, vector


@vector
class LoadFactorPath(Vector[T]):
    """The quantities that are limited along the path of a model without angles, (16) of the paper.

    States and controls have bounds of their own.
    """

    C_L: T = quantity("1", text="lift coefficient")
    beta_A: T = quantity("rad", scale=0.2, text="sideslip")


def load_factor_coefficients(
    n_z: Scalar, n_y: Scalar, *, flow: Airflow, rho: Scalar, aircraft: AircraftParameters[Scalar]
) -> tuple[Scalar, Scalar]:
    """Return `(C_L, beta_A)`: the lift coefficient and the sideslip (rad) that make the load factors (g)."""
    V_A2 = flow.V_A * flow.V_A
    load = aircraft.m * g0 / (0.5 * rho * V_A2 * aircraft.S)
    across = flow.u * flow.u + flow.v * flow.v  # V_A^2 (1 - a_z^2)
    return load * n_z * sqrt(V_A2 / across), load * n_y / aircraft.C_Y_trim


def axial_load_factor(
    n_z: Scalar,
    n_y: Scalar,
    *,
    C_L: Scalar,
    beta_A: Scalar,
    delta_T: Scalar,
    flow: Airflow,
    rho: Scalar,
    aircraft: AircraftParameters[Scalar],
) -> Scalar:
    """Return `n_x` (g) from the balance of thrust, drag, lift and side force along V_K."""
    D = 0.5 * rho * (flow.V_A * flow.V_A) * aircraft.S * drag_coefficient(C_L, beta_A, aircraft)
    T_minus_D = thrust(delta_T, flow.V_A, rho, aircraft) - D
    # the equation above, numerator and denominator times V_A
    return (T_minus_D / (aircraft.m * g0) * flow.V_A - flow.v * n_y + flow.w * n_z) / flow.u
