"""The quantities that a pilot's limits hold of: load factors, onset, roll rate, sideslip, and those of a steady turn.

In a steady turn the path keeps its climb angle: without side force the vertical part of the lift carries the weight,
`n_z cos(mu) = cos(gamma)`. With `R_33 = cos(gamma) cos(mu)` the load factor of the turn at a bank is

    n_turn = cos(gamma) / cos(mu) = cos(gamma)^2 / R_33,        |n_z - n_turn| <= d  where R_33 > 0

and multiplied by `R_33` these are two polynomials in the entries of R, which need no angles. In knife-edge flight there
is no steady turn. The roll rate is that of Kbar about the path, `2 (q* o q')_1` of a unit quaternion.

Near the ground the least load factor is `n_low`; above the height `h_low` it falls by `RELIEF_SLOPE` per metre:

    n_z + RELIEF_SLOPE max(h - h_low, 0) >= n_low

Rates are those with all controls at zero. The point mass has no onset: the rate of its load factor is a control.
"""

from collections.abc import Sequence

import casadi as ca

from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.elementary import maximum, smooth_maximum
from airrace.model.frames import QUATERNION, product, rotation
from airrace.optimal_control.quantities import Quantity, Scalar
from airrace.optimal_control.system import Observation, column, named_symbols

RELIEF_SLOPE = 0.1
"""How much less load factor is asked for per metre above the height near the ground, g/m: a choice."""
RELIEF_WIDTH = 0.5
"""The width of the rounding at that height, m; the limit is stricter by at most the slope times half of it."""

LOAD_FACTOR = Quantity("load_factor", "1", scale=5.0, text="load factor at a crossing")
ROLL_RATE = Quantity("roll_rate", "rad/s", text="roll rate about the velocity at a crossing")
TURN_EXCESS = Quantity("turn_excess", "1", text="load factor above that of a steady turn and its tolerance")
TURN_LACK = Quantity("turn_lack", "1", text="load factor below that of a steady turn and its tolerance")
ONSET = Quantity("onset", "1/s", text="onset of the load factor at a crossing")
LATERAL_LOAD_FACTOR = Quantity("lateral_load_factor", "1", text="lateral load factor at a crossing")
SIDESLIP = Quantity("sideslip", "rad", scale=0.2, text="sideslip at a crossing")
LOW_LOAD_FACTOR = Quantity("low_load_factor", "1", scale=5.0, text="load factor near the ground")
TOLERANCE = Quantity("turn_tolerance", "1", text="largest deviation from the load factor of a steady turn")
LOW_HEIGHT = Quantity("low_height", "m", scale=100.0, text="height that counts as near the ground")


def crossing_observation_of_pilot(model: FlightModel) -> Observation:
    """Return the observation at a crossing; its parameters are the tolerance, then the numbers of the model."""
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    states, numbers, tolerance = column(x.values()), column(p.values()), ca.SX.sym("tolerance")
    rates = system.rates(states, column([0.0] * len(system.controls)), numbers)
    by_name: dict[str, Scalar] = dict(zip(x, rates.elements(), strict=True))
    n_z, n_y, beta_A = (_at_rest(model, x, numbers, name) for name in ("n_z", "n_y", "beta_A"))
    q = [x[name] for name in QUATERNION]
    R, length = rotation(q), sum(component * component for component in q)
    turned = product([q[0], -q[1], -q[2], -q[3]], [by_name[name] for name in QUATERNION])
    level = 1.0 - R[2][0] * R[2][0]
    off, allowed = n_z * R[2][2] - level, tolerance * R[2][2]
    declared = [LOAD_FACTOR, ROLL_RATE, TURN_EXCESS, TURN_LACK, LATERAL_LOAD_FACTOR, SIDESLIP]
    values: list[Scalar] = [n_z, 2.0 * turned[1] / length, off - allowed, -off - allowed, n_y, beta_A]
    if not any(control.rate_of == "n_z" for control in system.controls):  # its rate follows from the states
        declared.append(ONSET)
        values.append(ca.jtimes(n_z, states, rates))
    parameters = [TOLERANCE, *system.parameters]
    return _observation("pilot_crossing", declared, states, parameters, [tolerance, *p.values()], values)


def low_flight_observation(model: FlightModel, *, exact: bool) -> Observation:
    """Return the observation near the ground; its parameters are that height, then the numbers of the model."""
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    height = ca.SX.sym("height")
    above = -x["z"] - height
    relief = maximum(above, 0.0) if exact else smooth_maximum(above, 0.0, RELIEF_WIDTH) - 0.5 * RELIEF_WIDTH
    values = [_at_rest(model, x, column(p.values()), "n_z") + RELIEF_SLOPE * relief]
    name = "low_flight_exact" if exact else "low_flight"
    parameters = [LOW_HEIGHT, *system.parameters]
    return _observation(name, [LOW_LOAD_FACTOR], column(x.values()), parameters, [height, *p.values()], values)


def _at_rest(model: FlightModel, x: dict[str, Scalar], numbers: Scalar, name: str) -> Scalar:
    """Return a state or a path quantity of a model that depends on no control."""
    if name in x:
        return x[name]
    system = model.system
    assert system.path_values is not None  # what is no state of a model is one of its path quantities
    row = [quantity.name for quantity in system.path].index(name)
    return system.path_values(column(x.values()), column([0.0] * len(system.controls)), numbers).elements()[row]


def _observation(
    name: str,
    quantities: Sequence[Quantity],
    states: Scalar,
    parameters: Sequence[Quantity],
    b: Sequence[Scalar],
    values: Sequence[Scalar],
) -> Observation:
    function = ca.Function(name, [states, column(b)], [column(values)], {"cse": True})
    return Observation(name.replace("_", " "), tuple(quantities), tuple(parameters), function)
