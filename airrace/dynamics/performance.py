"""The figures of a flight manual, by the equations of flight: steady flight at full throttle, ISA at sea level.

stall       m g0 = rho/2 V_S^2 S C_L_max
top speed   T(V) = D(V) in level flight, the largest such V
climb       V sin gamma, m g0 sin gamma = T - D, lift m g0 cos gamma, at the best speed
roll        C_lxi xi_max + C_lp p b/(2 V) = 0
turn        T(V) = D(V, n), the largest n that lift, strength and thrust allow, at the best speed
"""

import dataclasses
import math
from collections.abc import Callable

from airrace.aircraft import Aircraft, AircraftParameters, aircraft_parameters
from airrace.dynamics.aerodynamics import drag_coefficient, thrust
from airrace.environment import RHO_ISA, g0
from airrace.records import record

FASTEST = 400.0
"""A speed that no aircraft with a propeller reaches in level flight, m/s."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@record
class Performance:
    """What an aircraft does in steady flight: speeds and `climb` in m/s, `roll_rate` in rad/s, `turn` in g.

    `speed_max` is 0 where power balances drag at no speed, `turn` likewise. `V_A` is the largest speed at which the
    wing stalls before it is overloaded, at most `speed_max`.
    """

    stall: float
    speed_max: float
    climb: float
    V_A: float
    roll_rate: float
    turn: float


def performance(aircraft: Aircraft, roll_speed: float | None = None) -> Performance:
    """Return all figures of an aircraft, the roll rate at a speed (m/s), by default `V_A`."""
    stall, fastest = stall_speed(aircraft), top_speed(aircraft)
    V_A = min(stall * math.sqrt(aircraft.envelope.n_z.upper), fastest or FASTEST)
    rolls = roll_rate(aircraft, roll_speed or V_A)
    return Performance(stall, fastest, climb_rate(aircraft), V_A, rolls, sustained_load_factor(aircraft))


def under(aircraft: Aircraft, mass: float | None, power: float | None) -> Aircraft:
    """Return an aircraft with another mass (kg) and power (W); None leaves its own."""
    airframe, engine = aircraft.airframe, aircraft.propulsion
    return dataclasses.replace(
        aircraft,
        airframe=dataclasses.replace(airframe, m=mass or airframe.m),
        propulsion=dataclasses.replace(engine, P_max=power or engine.P_max),
    )


def stall_speed(aircraft: Aircraft) -> float:
    """Return the least speed of level flight, m/s."""
    airframe = aircraft.airframe
    return math.sqrt(2.0 * airframe.m * g0 / (RHO_ISA * airframe.S * aircraft.lift.C_L_max))


def top_speed(aircraft: Aircraft) -> float:
    """Return the largest speed of level flight, m/s; 0 where there is none."""
    numbers, slow = aircraft_parameters(aircraft), _best_climb_speed(aircraft)
    if _climb_rate(numbers, slow) <= 0.0:
        return 0.0
    return bisect(lambda V: full_thrust(numbers, V) - _drag(numbers, V, 1.0), slow, FASTEST)


def climb_rate(aircraft: Aircraft) -> float:
    """Return the best rate of climb, m/s; below zero for an aircraft that cannot fly level."""
    return _climb_rate(aircraft_parameters(aircraft), _best_climb_speed(aircraft))


def roll_rate(aircraft: Aircraft, V: float) -> float:
    """Return the steady roll rate of full ailerons at a speed (m/s), rad/s."""
    roll = aircraft.roll
    return roll.C_lxi / roll.C_lp * aircraft.surfaces.xi.upper * 2.0 * V / aircraft.airframe.b


def sustained_load_factor(aircraft: Aircraft) -> float:
    """Return the largest load factor of a level turn that holds height and speed, g; 0 where there is none."""
    numbers = aircraft_parameters(aircraft)

    def load_factor(V: float) -> float:
        qS = 0.5 * RHO_ISA * V * V * numbers.S
        induced = max(full_thrust(numbers, V) / qS - numbers.C_D0, 0.0)
        C_L = numbers.C_L_minD + math.sqrt(induced / numbers.k) if induced else 0.0
        return qS * min(C_L, aircraft.lift.C_L_max) / (numbers.m * g0)

    best = load_factor(_maximum(load_factor, stall_speed(aircraft), FASTEST))
    return min(best, aircraft.envelope.n_z.upper) if best >= 1.0 else 0.0


def full_thrust(numbers: AircraftParameters[float], V: float) -> float:
    """Return the thrust at full throttle at a speed (m/s), N."""
    return float(thrust(1.0, V, RHO_ISA, numbers))


def bisect(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function that is positive at `low` and negative at `high`, whichever is larger."""
    for _ in range(50):  # until no digit is left
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _drag(numbers: AircraftParameters[float], V: float, load_factor: float) -> float:
    qS = 0.5 * RHO_ISA * V * V * numbers.S
    return qS * drag_coefficient(load_factor * numbers.m * g0 / qS, 0.0, numbers)


def _climb_rate(numbers: AircraftParameters[float], V: float) -> float:
    """Return the rate of climb at a speed, m/s: a fixed point, for the induced drag hardly depends on the climb."""
    pull, sine = full_thrust(numbers, V), 0.0
    for _ in range(10):
        sine = (pull - _drag(numbers, V, math.sqrt(1.0 - sine * sine))) / (numbers.m * g0)
        sine = min(max(sine, -1.0), 1.0)
    return V * sine


def _best_climb_speed(aircraft: Aircraft) -> float:
    numbers = aircraft_parameters(aircraft)
    return _maximum(lambda V: _climb_rate(numbers, V), stall_speed(aircraft), FASTEST)


def _maximum(value: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function with one maximum has it, by golden sections."""
    while high - low > 1e-3:
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (left, high) if value(left) < value(right) else (low, right)
    return 0.5 * (low + high)
