"""The race in airrace's own engine: direct multiple shooting with native kernels."""

import time

import casadi as ca
import numpy as np

from airrace.optimal_control.kernels import build_kernels
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Boundary, Iterate, Phase, Problem, uniform
from airrace.optimal_control.quantities import Interval, Quantity
from airrace.optimal_control.runge_kutta import RungeKutta
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.optimal_control.solvers.solver import PreparedProblem
from airrace.optimal_control.system import Observation, column, named_symbols
from peers.measured import Answer, Flight
from peers.race import Gate, Race, crossing

DURATION = Interval(0.1, 30.0)  # s, of a phase


def problem(race: Race, segments: int, scheme: RungeKutta) -> Problem:
    """The race in airrace's language of problems."""
    observation = _crossing(race)
    names = [one.name for one in race.model.system.states]
    start = Boundary("start", {name: Interval.exactly(v) for name, v in zip(names, race.start.tolist(), strict=True)})
    phases = tuple(
        Phase(f"gate {number}", uniform(segments), DURATION, end=_end(gate, observation))
        for number, gate in enumerate(race.gates, start=1)
    )
    parameters = tuple(race.model.parameter_values.tolist())
    return Problem(race.model.system, parameters, start, phases, scheme=scheme, time_scale=4.0)


def solve(race: Race, segments: int, scheme: RungeKutta, tolerance: float) -> Answer:
    """Solve in this process with one thread."""
    guess = race.guess(segments)
    states = np.hstack([guess.states[0], *(one[:, 1:] for one in guess.states[1:])])
    began, spent = time.perf_counter(), time.process_time()
    stated = problem(race, segments, scheme)
    layout = Layout(stated)
    kernels = build_kernels(stated.system, scheme)
    options = SolverOptions(tolerance=tolerance, curvature=False)
    prepared = PreparedProblem(layout, kernels, "interior-point", options, 1)
    ready, ready_spent = time.perf_counter(), time.process_time()
    held = np.repeat(guess.control[:, None], stated.intervals, axis=1)
    solution = prepared.solve(layout, Iterate(guess.durations, states, held))
    done, done_spent = time.perf_counter(), time.process_time()
    nodes, phases = stated.first_node, len(race.gates)
    flight = Flight(
        solution.iterate.durations,
        solution.iterate.state[:, nodes[:-1]],
        solution.iterate.state[:, nodes[1:]],
        solution.iterate.control.reshape(-1, phases, segments),
    )
    return Answer(
        flight=flight if solution.success else None,
        status=solution.status,
        iterations=solution.iterations,
        setup=ready - began,
        solve=done - ready,
        processor=done_spent - spent,
        processor_solve=done_spent - ready_spent,
    )


def _crossing(race: Race) -> Observation:
    """How the path crosses a heading, which is a parameter."""
    x, b = named_symbols(race.model.system.states), {name: ca.SX.sym(name) for name in ("cosine", "sine")}
    seen = crossing([x[name] for name in ("q0", "q1", "q2", "q3")], b["cosine"], b["sine"])
    return Observation(
        name="crossing",
        quantities=(Quantity("across", "1"), Quantity("down", "1")),
        parameters=(Quantity("cosine", "1"), Quantity("sine", "1")),
        values=ca.Function("crossing", [column(x.values()), column(b.values())], [column(seen)]),
    )


def _end(gate: Gate, observation: Observation) -> Boundary:
    place = {name: Interval.exactly(value) for name, value in zip("xyz", gate.position, strict=True)}
    if not gate.fixed:
        return Boundary("point", place)
    still = {"across": Interval.exactly(0.0), "down": Interval.exactly(0.0)}
    values = (float(np.cos(gate.heading)), float(np.sin(gate.heading)))
    return Boundary("point", place | still, observation, values)
