"""From the equations of a model, written for named vectors, to a system that can be optimised."""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import casadi as ca
import numpy as np

from airrace.dynamics.aircraft_parameters import AircraftParameters
from airrace.dynamics.flight_model import FlightModel, attitude_projection, column, named_symbols
from airrace.dynamics.outer_loop import FlightPathState
from airrace.dynamics.roll_counter import RollCounter, RollReset, counter_rates
from airrace.environment.air import Air
from airrace.environment.atmosphere import AtmosphereParameters, atmosphere_parameters
from airrace.environment.wind import WindField
from airrace.frames import Scalar
from airrace.quantities import Quantity, Vector
from airrace.system import System

State = TypeVar("State", bound=FlightPathState[Scalar])
Control = TypeVar("Control", bound=Vector[Scalar], contravariant=True)
Path = TypeVar("Path", bound=Vector[Scalar], covariant=True)
Numbers = TypeVar("Numbers", bound=AircraftParameters[Scalar], contravariant=True)


class Equations(Protocol[State, Control, Path, Numbers]):
    """A model: time derivatives of the state, and the path quantities, as a pure function of named vectors."""

    def __call__(
        self,
        state: State,
        control: Control,
        *,
        aircraft: Numbers,
        atmosphere: AtmosphereParameters[Scalar],
        field: WindField,
        wind: Sequence[Scalar],
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
) -> FlightModel:
    """The model as a system, together with the numbers of one aircraft in one air.

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
    """
    field = WindField.of(air)
    own_states, own_controls, path = declarations
    states = (*own_states, *(RollCounter.quantities() if counting else ()))
    controls = (*own_controls, *(RollReset.quantities() if counting else ()))
    parameters = (*aircraft.quantities(), *AtmosphereParameters.quantities(), *field.parameters)
    x, u, p = named_symbols(states), named_symbols(controls), named_symbols(parameters)
    state = vectors[0](**{one.name: x[one.name] for one in own_states})
    rates, path_values = equations(
        state,
        vectors[1](**{one.name: u[one.name] for one in own_controls}),
        aircraft=type(aircraft)(**{name: p[name] for name in aircraft.names()}),
        atmosphere=AtmosphereParameters(**{name: p[name] for name in AtmosphereParameters.names()}),
        field=field,
        wind=[p[one.name] for one in field.parameters],
    )
    all_rates = list(rates.join())
    if counting:
        reset = RollReset(**{name: u[name] for name in RollReset.names()})
        all_rates += counter_rates(roll_rate(state, path_values), rates.z, reset).join()
    arguments = [column(symbols.values()) for symbols in (x, u, p)]
    system = System(
        name="+".join(part for part in (name, field.label, "rolls" if counting else "") if part),
        states=states,
        controls=controls,
        parameters=parameters,
        rates=ca.Function("rates", arguments, [column(all_rates)], {"cse": True}),
        path=tuple(path),
        path_values=ca.Function("path_values", arguments, [column(path_values.join())], {"cse": True}),
        projection=attitude_projection(states),
    )
    values = [*aircraft.join(), *atmosphere_parameters(air).join(), *field.values(air)]
    return FlightModel(system, np.array(values), at_rest)
