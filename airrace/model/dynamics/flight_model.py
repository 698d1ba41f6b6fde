"""A flight model: a system assembled from equations for named vectors, and the numbers of one aircraft in one air.

Two states may count the angle rolled and the height gained since a roll began; two controls wind them back to zero
before it and rest during it. Only the flight through a course with a roll carries them:

    Phi' = p_Kbar + Phi_reset,     gain' = -z' + gain_reset
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from airrace.model.aircraft import AircraftParameters
from airrace.model.dynamics.aerodynamics import airflow
from airrace.model.dynamics.outer_loop import FlightPathState
from airrace.model.dynamics.own_limits import Instant, Limit, limits, require_new_names
from airrace.model.environment import Air, AtmosphereParameters, Weather, WindField, atmosphere_parameters, density
from airrace.model.frames import QUATERNION, normalise, rotation
from airrace.optimal_control.quantities import Interval, Quantity, Scalar, T, Vector, quantity, vector
from airrace.optimal_control.system import System, column, named_symbols
from airrace.runtime.extensions import named_errors


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
"""The bounds of the controls in the phase of a roll: nothing is wound back."""

OF_MODELS = ("n_z", "n_y", "C_L", "beta_A")
"""What is a state of some models, a path quantity of others, and known to own limits by the same names."""

FROM_ZERO = {name: Interval.exactly(0.0) for name in RollCounter.names()}
"""The bounds of the counters where that phase begins: both are zero."""


@dataclasses.dataclass(frozen=True, eq=False)
class FlightModel:
    """A model ready to fly: a system and the numbers of one aircraft in one air.

    Attributes:
        system: states, controls and equations; the same equations serve every aircraft and air of equal structure.
        parameter_values: values of `system.parameters`, shape (n_p,).
        at_rest: names of the states of the inner loop whose rates are zero in a steady flight.
        brisk: by name, the controls that are measured by a brisk value of their own (in their unit) where their cost is
            weighed; the others are measured by half of what their bounds allow.
    """

    system: System
    parameter_values: NDArray[np.float64]
    at_rest: tuple[str, ...] = ()
    brisk: Mapping[str, float] = field(default_factory=dict[str, float])


State = TypeVar("State", bound=FlightPathState[Scalar])
Control = TypeVar("Control", bound=Vector[Scalar], contravariant=True)
Path = TypeVar("Path", bound=Vector[Scalar], covariant=True)
Numbers = TypeVar("Numbers", bound=AircraftParameters[Scalar], contravariant=True)


class Equations(Protocol[State, Control, Path, Numbers]):
    """A model: the time derivatives of its state and its path quantities as a pure function of named vectors."""

    def __call__(
        self,
        state: State,
        control: Control,
        *,
        aircraft: Numbers,
        weather: Weather,
    ) -> tuple[State, Path]: ...


def assemble(
    name: str,
    equations: Equations[State, Control, Path, Numbers],
    vectors: tuple[type[State], type[Control], type[Path]],
    bounds: Mapping[str, Interval],
    *,
    roll_rate: Callable[[State, Path], Scalar],
    at_rest: tuple[str, ...],
    aircraft: Numbers,
    air: Air,
    counting: bool,
    brisk: Mapping[str, float] | None = None,
) -> FlightModel:
    """Return a model as a system, together with the numbers of one aircraft in one air.

    Args:
        name: of the model; wind and counting are added to it.
        equations: the model.
        vectors: the classes of its state, control and path quantities.
        bounds: of any of these, by name; the others keep those of their declarations.
        roll_rate: `p_Kbar` from state and path quantities, rad/s; it is what a roll counter counts.
        at_rest: see `FlightModel`.
        aircraft: numbers of the aircraft.
        air: the day's air and wind.
        counting: whether rolls are counted.
        brisk: see `FlightModel`.

    Raises:
        KeyError: a bound names no quantity.
        UsageError: a limit of an extension has the name of a quantity of the model.
    """
    wind, own = WindField.from_air(air), limits()
    structure = _Structure(equations, vectors, type(aircraft), wind, counting, own, roll_rate)
    taken = (*structure.states, *structure.controls, *vectors[2].quantities())
    require_new_names(own, {quantity.name for quantity in taken}, name)
    rates, path_values, projection = functions(structure)
    declared = structure.states, structure.controls, vectors[2].quantities()
    if unknown := bounds.keys() - {quantity.name for quantities in declared for quantity in quantities}:
        raise KeyError(", ".join(sorted(unknown)))
    states, controls, path = (_with_bounds(quantities, bounds) for quantities in declared)
    system = System(
        name="+".join(
            part
            for part in (name, wind.label, "rolls" if counting else "", *(limit.quantity.name for limit in own))
            if part
        ),
        states=states,
        controls=controls,
        parameters=structure.parameters,
        rates=rates,
        path=(*path, *(limit.quantity for limit in own)),
        path_values=path_values,
        projection=projection,
    )
    values = [*aircraft.join(), *atmosphere_parameters(air).join(), *wind.values(air)]
    return FlightModel(system, np.array(values), at_rest, brisk or {})


def _with_bounds(quantities: Sequence[Quantity], bounds: Mapping[str, Interval]) -> tuple[Quantity, ...]:
    bounded: list[Quantity] = []
    for declared in quantities:
        bound = bounds.get(declared.name, Interval(declared.lower, declared.upper))
        bounded.append(dataclasses.replace(declared, lower=bound.lower, upper=bound.upper))
    return tuple(bounded)


# Any in what follows: the vectors of an arbitrary model, which fit its equations as `assemble` demands.


@dataclasses.dataclass(frozen=True)
class _Structure:
    """Everything that the functions of a model depend on.

    The roll rate is left out of comparisons, for it belongs to the equations.
    """

    equations: Equations[Any, Any, Any, Any]
    vectors: tuple[type[Vector[Any]], type[Vector[Any]], type[Vector[Any]]]
    numbers: type[AircraftParameters[Any]]
    wind: WindField
    counting: bool
    limits: tuple[Limit, ...]
    roll_rate: Callable[[Any, Any], Scalar] = field(compare=False)

    @property
    def states(self) -> tuple[Quantity, ...]:
        return (*self.vectors[0].quantities(), *(RollCounter.quantities() if self.counting else ()))

    @property
    def controls(self) -> tuple[Quantity, ...]:
        return (*self.vectors[1].quantities(), *(RollReset.quantities() if self.counting else ()))

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        return (*self.numbers.quantities(), *AtmosphereParameters.quantities(), *self.wind.parameters)


@functools.lru_cache(maxsize=32)
def functions(of: _Structure) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Return the rates, the path quantities and the projection of a structure as casadi functions.

    The projection brings the attitude back to unit length. They are made once per structure, for many models differ in
    numbers alone.
    """
    x, u, p = named_symbols(of.states), named_symbols(of.controls), named_symbols(of.parameters)
    state = _pick(of.vectors[0], x)
    weather = Weather(_pick(AtmosphereParameters, p), of.wind, [p[parameter.name] for parameter in of.wind.parameters])
    control, aircraft = _pick(of.vectors[1], u), _pick(of.numbers, p)
    rates, path_values = of.equations(state, control, aircraft=aircraft, weather=weather)
    all_rates = list(rates.join())
    if of.counting:
        all_rates += [of.roll_rate(state, path_values) + u["Phi_reset"], u["gain_reset"] - rates.z]
    own = _own_limits(of, state, path_values, aircraft, weather)
    unit = dict(zip(QUATERNION, normalise([x[name] for name in QUATERNION]), strict=True))
    arguments = [column(symbols.values()) for symbols in (x, u, p)]
    return (
        ca.Function("rates", arguments, [column(all_rates)], {"cse": True}),
        ca.Function("path_values", arguments, [column([*path_values.join(), *own])], {"cse": True}),
        ca.Function("projection", arguments[:1], [column((x | unit).values())], {"cse": True}),
    )


def _own_limits(of: _Structure, state: Any, path: Any, aircraft: Any, weather: Weather) -> list[Scalar]:
    """Return the values of the limits of extensions."""
    if not of.limits:
        return []
    R = rotation(state.q)
    known = {name: getattr(path, name) if hasattr(path, name) else getattr(state, name) for name in OF_MODELS}
    instant = Instant(
        north=state.x,
        east=state.y,
        height=-state.z,
        V_K=state.V_K,
        V_A=airflow(state, R, weather).V_A,
        sin_climb=-R[2][0],
        rho=density(state.z, weather.atmosphere),
        p_Kbar=of.roll_rate(state, path),
        delta_T=state.delta_T,
        aircraft=aircraft,
        **known,
    )
    values: list[Scalar] = []
    for limit in of.limits:
        with named_errors(f"{limit.file} has the limit {limit.quantity.name}", limit.file):
            values.append(limit.value(instant))
    return values


def _pick(kind: type[Vector[Any]], symbols: Mapping[str, Scalar]) -> Any:
    """Return a vector of the symbols that have the names of its components."""
    return kind(**{name: symbols[name] for name in kind.names()})
