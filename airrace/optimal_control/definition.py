"""The statement of a problem in one call, with equations of named symbols.

    def rates(x, u):
        return {"x": x.v, "v": u.f}

    define_problem(
        "sliding mass",
        rates,
        states=[Quantity("x", "m"), Quantity("v", "m/s")],
        controls=[Quantity("f", "m/s2", lower=-20.0, upper=20.0)],
        start=at(x=0.0, v=0.0),
        phases=[Phase("move", uniform(20), Interval(0.1, 5.0), at(x=1.0, v=0.0))],
    )

Parameters to be optimised, integral costs and costs of the ends of several phases become states here: a parameter is a
state whose rate is zero, an integral one whose rate is the integrand, and what a cost sees of the end of an earlier
phase is carried to the final time by a state without a rate.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, TypeAlias

import casadi as ca

from airrace.optimal_control.problem import Boundary, Objective, Phase, Problem, require_valid
from airrace.optimal_control.quantities import Interval, Quantity, Scalar
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RungeKutta
from airrace.optimal_control.system import SYMBOLS, Observation, System, column

INTEGRAL_COST, END_COST, CLOCK = "integral_cost", "end_cost", "clock"
"""The names of the state that integrates a cost, of the cost of the ends of phases, and of a clock's state."""

Range: TypeAlias = float | Interval | tuple[float | None, float | None]
Equation: TypeAlias = Callable[[Any, Any], Scalar]
"""A function of states (with parameters) and controls, both with symbols by name, to an expression."""
NO_OUTPUTS: Mapping[Quantity, Equation] = MappingProxyType({})


def at(label: str = "", /, **ranges: Range) -> Boundary:
    """Return conditions on states, or on outputs of states alone: `at(x=0.0, v=(None, 5.0))`.

    Args:
        label: for messages; by default the start, or the end of the phase.
        ranges: by name: a value; a range, of which an end may be None; or an `Interval`.
    """
    return Boundary(label, {name: _interval(value) for name, value in ranges.items()})


def _interval(value: Range) -> Interval:
    if isinstance(value, Interval):
        return value
    return Interval.between(*value) if isinstance(value, tuple) else Interval.exactly(value)


def define_problem(
    name: str,
    rates: Callable[[Any, Any], Mapping[str, Scalar]],  # Any: namespaces of symbols
    *,
    states: Sequence[Quantity],
    start: Boundary,
    phases: Sequence[Phase],
    controls: Sequence[Quantity] = (),
    parameters: Sequence[Quantity] = (),
    outputs: Mapping[Quantity, Equation] = NO_OUTPUTS,
    time_cost: float | None = None,
    integral_cost: Equation | None = None,
    end_cost: Callable[[Sequence[Any]], Scalar] | None = None,
    cost_scale: float = 1.0,
    scheme: RungeKutta = DORMAND_PRINCE_5,
    time_scale: float = 1.0,
) -> Problem:
    """State a problem: minimise `time_cost t_f + integral of integral_cost dt + end_cost`.

    Args:
        name: of the system.
        rates: maps states x and controls u, with symbols by name (`x.v`), to the rates of all states by name.
            Parameters are among the attributes of x.
        states, controls: their declarations; bounds hold everywhere.
        start: conditions at the start of the first phase, see `at`.
        phases: in their order.
        parameters: constants to be optimised within their bounds.
        outputs: quantities that follow from x and u. Their bounds hold along the path, phases may narrow them, and
            boundaries may bound those that depend on x alone.
        time_cost: weight of the final time, per s; by default 1 if there is no other cost, else 0.
        integral_cost: the integrand, of x and u.
        end_cost: maps the states at the start and at the ends of all phases (n + 1, each before any jump; their `clock`
            is the time since the start, s) to a cost.
        cost_scale: typical size of the integral.
        scheme: integrates an interval.
        time_scale: typical duration of a phase, s.

    Raises:
        ValueError: rates are missing or too many, or the problem does not say what it seems to say.
    """
    with SYMBOLS:
        definition = _Definition(states, parameters, controls)
        definition.set_rates(name, rates)
        if integral_cost is not None:
            rate = integral_cost(definition.x, definition.u)
            definition.add_state(Quantity(INTEGRAL_COST, "1", cost_scale, text="integral of the cost"), rate, begin=0.0)
        cost = None if end_cost is None else definition.carried_cost(end_cost, len(phases))
        expressions = {output.name: equation(definition.x, definition.u) for output, equation in outputs.items()}
        boundaries = [start, *(phase.end for phase in phases)]
        places = ["the start", *(f"the end of {phase.name}" for phase in phases)]
        bounded = [
            definition.boundary(number, replace(boundary, name=boundary.name or place), list(outputs), expressions)
            for number, (boundary, place) in enumerate(zip(boundaries, places, strict=True))
        ]
        if time_cost is None:
            time_cost = 1.0 if integral_cost is None and end_cost is None else 0.0
        terminal = {} if integral_cost is None else {INTEGRAL_COST: 1.0}
        observation = None
        if cost is not None:
            terminal[END_COST] = 1.0
            observation = definition.observation(END_COST, [Quantity(END_COST, "1")], [cost])
        system = definition.system(name, list(outputs), expressions.values())
    problem = Problem(
        system,
        parameters=(),
        start=bounded[0],
        phases=tuple(replace(phase, end=end) for phase, end in zip(phases, bounded[1:], strict=True)),
        objective=Objective(time=time_cost, terminal=terminal, observation=observation),
        scheme=scheme,
        time_scale=time_scale,
    )
    require_valid(problem)
    return problem


class Symbols:
    """Symbols by name, as the attributes of what equations are functions of."""

    def __init__(self, symbols: Mapping[str, ca.SX]) -> None:
        self.__dict__.update(symbols)

    def __getattr__(self, name: str) -> ca.SX:
        """Refuse a name that there is not.

        Raises:
            AttributeError: always, for Python looks here last.
        """
        raise AttributeError(f"there is no {name!r} here, only {', '.join(self.__dict__) or 'nothing'}")


class _Definition:
    """The states of a problem with their rates, while those are added that costs need.

    Attributes:
        x, u: symbols of states and parameters, and of controls, by name.
    """

    def __init__(
        self, states: Sequence[Quantity], parameters: Sequence[Quantity], controls: Sequence[Quantity]
    ) -> None:
        self._states = [*states, *parameters]
        self._controls = list(controls)
        self._own = {state.name for state in states}
        self._constant = {parameter.name for parameter in parameters}
        self._symbols = {quantity.name: ca.SX.sym(quantity.name) for quantity in self._states}
        self._control_symbols = {quantity.name: ca.SX.sym(quantity.name) for quantity in controls}
        self._rates: dict[str, Scalar] = {}
        self._begins: dict[str, float] = {}
        self._ties: list[tuple[int, str, str]] = []  # boundary, state, what carries it
        self.x, self.u = Symbols(self._symbols), Symbols(self._control_symbols)

    def set_rates(self, name: str, rates: Callable[[Any, Any], Mapping[str, Scalar]]) -> None:
        """Take the rates of the user's states."""
        values = rates(self.x, self.u)
        if not hasattr(values, "keys"):
            raise ValueError(f"the rates of {name!r} are no dictionary of rates by the names of the states")
        if missing := self._own - values.keys():
            raise ValueError(f"the rates of {name!r} have none of {', '.join(sorted(missing))}")
        if unknown := values.keys() - self._own:
            raise ValueError(f"the rates of {name!r} have some of {', '.join(sorted(unknown))}, which are no states")
        self._rates = dict(values)

    def add_state(self, quantity: Quantity, rate: Scalar, *, begin: float | None = None) -> None:
        """Add a state, and the value with which it begins."""
        if quantity.name in self._symbols:
            raise ValueError(f"{quantity.name} is the name of a state that the cost needs; call yours otherwise")
        self._states.append(quantity)
        self._symbols[quantity.name] = ca.SX.sym(quantity.name)
        self._rates[quantity.name] = rate
        if begin is not None:
            self._begins[quantity.name] = begin

    def carried_cost(self, end_cost: Callable[[Sequence[Any]], Scalar], phases: int) -> Scalar:
        """Return a cost of the ends of phases in terms of the final state, with states that carry the earlier ones."""
        visible = [*self._own, *self._constant, *({CLOCK} - self._own)]
        ends = [{name: ca.SX.sym(f"{name}_{number}") for name in visible} for number in range(phases + 1)]
        cost = ca.SX(end_cost([Symbols(end) for end in ends]))
        used = [[name for name, symbol in end.items() if ca.depends_on(cost, symbol)] for end in ends]
        if CLOCK not in self._own and any(CLOCK in names for names in used[1:]):
            self.add_state(Quantity(CLOCK, "s", text="time since the start"), 1.0, begin=0.0)
        declared = {quantity.name: quantity for quantity in self._states}
        for number, names in enumerate(used):
            for name in names:
                if number == phases or name in self._constant:
                    final: Scalar = self._symbols[name]
                elif name == CLOCK and number == 0 and CLOCK not in self._own:
                    final = ca.SX(0.0)
                else:
                    place = f"the end of phase {number}" if number else "the start"
                    carrier = f"{name}_at_{place.removeprefix('the ').replace(' ', '_')}"
                    source = declared[name]
                    self.add_state(Quantity(carrier, source.unit, source.scale, text=f"{name} at {place}"), 0.0)
                    self._ties.append((number, name, carrier))
                    final = self._symbols[carrier]
                cost = ca.substitute(cost, ends[number][name], final)
        return cost

    def boundary(
        self, number: int, boundary: Boundary, outputs: Sequence[Quantity], expressions: Mapping[str, Scalar]
    ) -> Boundary:
        """Return a boundary with what is asked there of outputs, carried states and integrals."""
        if boundary.observation is not None:
            raise ValueError(f"boundary {boundary.name!r} has an observation; declare what it observes as an output")
        bounds = dict(boundary.bounds)
        quantities = [output for output in outputs if output.name in bounds]
        values = [expressions[output.name] for output in quantities]
        for quantity, value in zip(quantities, values, strict=True):
            if any(ca.depends_on(ca.SX(value), symbol) for symbol in self._control_symbols.values()):
                raise ValueError(f"{quantity.name} depends on controls, so no boundary can bound it")
        for place, name, carrier in self._ties:
            if place == number:
                source = next(quantity for quantity in self._states if quantity.name == name)
                quantities.append(Quantity(f"{carrier}_as_carried", source.unit, source.scale))
                values.append(self._symbols[name] - self._symbols[carrier])
                bounds[quantities[-1].name] = Interval.exactly(0.0)
        if number == 0:
            bounds.update({name: Interval.exactly(begin) for name, begin in self._begins.items()})
        observation = self.observation(f"boundary {number}", quantities, values) if quantities else None
        return Boundary(boundary.name, bounds, observation)

    def observation(self, name: str, quantities: Sequence[Quantity], values: Sequence[Scalar]) -> Observation:
        """Return an observation of all states."""
        function = ca.Function("observe", [column(self._symbols.values()), ca.SX.sym("b", 0)], [column(values)])
        return Observation(name, tuple(quantities), (), function)

    def system(self, name: str, outputs: Sequence[Quantity], values: Iterable[Scalar]) -> System:
        """Return the system of all states."""
        x, u, p = column(self._symbols.values()), column(self._control_symbols.values()), ca.SX.sym("p", 0)
        rates = [self._rates.get(state.name, 0.0) for state in self._states]
        return System(
            name=name,
            states=tuple(self._states),
            controls=tuple(self._controls),
            parameters=(),
            rates=ca.Function("rates", [x, u, p], [column(rates)]),
            path=tuple(outputs),
            path_values=ca.Function("path", [x, u, p], [column(values)]) if outputs else None,
        )
