"""The assembly of a system that can be optimised from a model's equations, which are written for named vectors."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol, TypeVar

import casadi as ca
import numpy as np

from airrace.dynamics.aircraft_parameters import AircraftParameters
from airrace.dynamics.flight_model import FlightModel, attitude_projection, column, named_symbols
from airrace.dynamics.outer_loop import FlightPathState
from airrace.dynamics.roll_counter import RollCounter, RollReset, counter_rates
from airrace.environment.air import Air
from airrace.environment.atmosphere import AtmosphereParameters, atmosphere_parameters
from airrace.environment.wind import Weather, WindField
from airrace.frames import Scalar
from airrace.quantities import Quantity, Vector
from airrace.records import record
from airrace.system import System

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
    vectors: tuple[type[State], type[Control]],
    declarations: tuple[Sequence[Quantity], Sequence[Quantity], Sequence[Quantity]],
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
        vectors: the classes of its state and control.
        declarations: state, control and path quantities with their bounds.
        roll_rate: `p_Kbar` from state and path quantities, rad/s; it is what a roll counter counts.
        at_rest: see `FlightModel`.
        aircraft: numbers of the aircraft.
        air: the day's air and wind.
        counting: whether rolls are counted.
        brisk: see `FlightModel`.
    """
    wind = WindField.of(air)
    own_states, own_controls, path = declarations
    states = (*own_states, *(RollCounter.quantities() if counting else ()))
    controls = (*own_controls, *(RollReset.quantities() if counting else ()))
    structure = _Structure(equations, vectors, type(aircraft), wind, counting, roll_rate)
    rates, path_values, projection = functions(structure)
    system = System(
        name="+".join(part for part in (name, wind.label, "rolls" if counting else "") if part),
        states=states,
        controls=controls,
        parameters=structure.parameters,
        rates=rates,
        path=tuple(path),
        path_values=path_values,
        projection=projection,
    )
    values = [*aircraft.join(), *atmosphere_parameters(air).join(), *wind.values(air)]
    return FlightModel(system, np.array(values), at_rest, brisk or {})


# Any in what follows: the vectors of an arbitrary model, which fit its equations as `assemble` demands.


@record
class _Structure:
    """Everything that the functions of a model depend on.

    The roll rate is left out of comparisons, for it belongs to the equations.
    """

    equations: Equations[Any, Any, Any, Any]
    vectors: tuple[type[Vector[Any]], type[Vector[Any]]]
    numbers: type[AircraftParameters[Any]]
    wind: WindField
    counting: bool
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

    They are made once per structure, for many models differ in numbers alone.
    """
    x, u, p = named_symbols(of.states), named_symbols(of.controls), named_symbols(of.parameters)
    state = of.vectors[0](**{name: x[name] for name in of.vectors[0].names()})
    rates, path_values = of.equations(
        state,
        of.vectors[1](**{name: u[name] for name in of.vectors[1].names()}),
        aircraft=of.numbers(**{name: p[name] for name in of.numbers.names()}),
        weather=Weather(
            atmosphere=AtmosphereParameters(**{name: p[name] for name in AtmosphereParameters.names()}),
            field=of.wind,
            wind=[p[one.name] for one in of.wind.parameters],
        ),
    )
    all_rates = list(rates.join())
    if of.counting:
        reset = RollReset(**{name: u[name] for name in RollReset.names()})
        all_rates += counter_rates(of.roll_rate(state, path_values), rates.z, reset).join()
    arguments = [column(symbols.values()) for symbols in (x, u, p)]
    return (
        ca.Function("rates", arguments, [column(all_rates)], {"cse": True}),
        ca.Function("path_values", arguments, [column(path_values.join())], {"cse": True}),
        attitude_projection(of.states),
    )
