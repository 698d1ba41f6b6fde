"""The thrust of a piston engine with propeller, and the lag of its power lever.

T = delta_T P sigma_P(rho) / sqrt(V_A^2 + V_s^2),   sigma_P = 1.132 rho/rho_0 - 0.132   [Gagg & Ferrar 1934]
delta_T_dot = (delta_T_cmd - delta_T) / tau_T
"""

from airrace.dynamics.aircraft_parameters import AircraftParameters
from airrace.environment.atmosphere import RHO_ISA
from airrace.environment.elementary import sqrt
from airrace.frames import Scalar


def power_ratio(rho: Scalar) -> Scalar:
    """Return `sigma_P`, the power of an unsupercharged engine at density `rho` (kg/m3) over that at sea level.

    Sea level is that of the standard atmosphere.
    """
    return (1.132 / RHO_ISA) * rho - 0.132


def thrust(delta_T: Scalar, V_A: Scalar, rho: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the thrust (N) at lever position `delta_T` (0 to 1), airspeed `V_A` (m/s) and density `rho` (kg/m3)."""
    return delta_T * aircraft.P * power_ratio(rho) / sqrt(V_A * V_A + aircraft.V_s * aircraft.V_s)


def lever_rate(delta_T: Scalar, delta_T_cmd: Scalar, aircraft: AircraftParameters[Scalar]) -> Scalar:
    """Return the rate of the power lever `delta_T_dot`, 1/s."""
    return (delta_T_cmd - delta_T) / aircraft.tau_T
