"""The flow relative to the aircraft, and its lift and drag coefficients."""

from collections.abc import Sequence

from airrace.aircraft.aircraft import Lift
from airrace.dynamics.aircraft_parameters import AircraftParameters
from airrace.environment.elementary import smooth_clip, sqrt
from airrace.environment.wind import WindField
from airrace.frames import Matrix, Scalar
from airrace.records import record

STALL_BLEND = 0.05
"""The width, in C_L, of the transition from the linear lift curve to its limits (1)."""


@record
class Airflow:
    """The velocity relative to the air in Kbar, m/s: `V_A a = (u, v, w)` with the unit vector `a`.

    Attributes:
        V_A: airspeed.
        u, v, w: forward along V_K, to the right, down.
    """

    V_A: Scalar
    u: Scalar
    v: Scalar
    w: Scalar


def still_airflow(V_K: Scalar) -> Airflow:
    """Return the flow without wind: the air meets the aircraft along the flight path at `V_K` (m/s)."""
    return Airflow(V_K, V_K, 0.0, 0.0)


def wind_airflow(V_K: Scalar, R: Matrix, V_W: Sequence[Scalar]) -> Airflow:
    """Return the flow of the wind triangle `V_A a = V_K e_x - R_OKbar^T V_W,O`.

    Args:
        V_K: kinematic speed, m/s.
        R: `R_OKbar`.
        V_W: wind in O, `[W_N, W_E, W_D]`, m/s.
    """
    W_N, W_E, W_D = V_W
    u = V_K - (R[0][0] * W_N + R[1][0] * W_E + R[2][0] * W_D)
    v = -(R[0][1] * W_N + R[1][1] * W_E + R[2][1] * W_D)
    w = -(R[0][2] * W_N + R[1][2] * W_E + R[2][2] * W_D)
    return Airflow(sqrt(u * u + v * v + w * w), u, v, w)


def airflow(
    position: tuple[Scalar, Scalar, Scalar], V_K: Scalar, R: Matrix, field: WindField, wind: Sequence[Scalar]
) -> Airflow:
    """Return the flow that an aircraft at `position` (x, y, z in O, m) meets.

    A field without wind adds no operation to the equations.
    """
    if not field.present:
        return still_airflow(V_K)
    return wind_airflow(V_K, R, field.velocity(*position, wind))


def drag_coefficient(C_L: Scalar, beta_A: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the drag coefficient `C_D = C_D0 + k (C_L - C_L_minD)^2 + C_Dbeta2 beta_A^2`."""
    excess = C_L - aircraft.C_L_minD
    return aircraft.C_D0 + aircraft.k * (excess * excess) + aircraft.C_Dbeta2 * (beta_A * beta_A)


def lift_curve(alpha_A: Scalar, lift: Lift) -> Scalar:
    """Return the lift coefficient at `alpha_A` (rad) with neutral controls and without rotation.

    It is linear in `alpha_A`, rounded off smoothly at `C_L_max` and `C_L_min`.
    """
    return smooth_clip(lift.C_L0 + lift.C_Lalpha * alpha_A, lift.C_L_min, lift.C_L_max, STALL_BLEND)
