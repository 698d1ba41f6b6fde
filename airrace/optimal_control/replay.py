"""The replay of an optimum: its controls integrated by an independent integrator, restarted at every node or phase.

scipy's DOP853 shares no code with the shooting scheme. It integrates the model's rates, see `function_at_points`; a
test holds the native ones against casadi's. Restarted at every node, all intervals are integrated side by side over
their own share of time, so one call serves a whole race; restarted at every phase, all phases side by side.
"""

import dataclasses
import logging
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.native.interpreter import interpreter
from airrace.optimal_control.constraint_rows import Indices
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.reference_integration import integrate
from airrace.optimal_control.runge_kutta import VERNER_7
from airrace.points import dense
from airrace.records import record
from airrace.system import System
from airrace.trajectory import Array

logger = logging.getLogger(__name__)

AtPoints = Callable[[Array], Array]
"""A function from states (n_x, n) to values (n_v, n), a new array."""


def function_at_points(function: ca.Function, control: Array, p: Array) -> AtPoints:
    """Return a function (x, u, p) -> values as a function of the states alone.

    Args:
        function: of SX, with one result.
        control, p: shapes (n_u, n), (n_p,).

    Raises:
        ValueError: on a call, if the states are not those of as many points as the controls.
    """
    parameters = np.ascontiguousarray(p, dtype=np.float64)
    native = interpreter()
    if native is not None:
        try:
            return native.at_points(dense(function), control, parameters)
        except KernelError as error:
            logger.info("casadi evaluates %s: %s", function.name(), error)
    return casadi_function_at_points(function, control, parameters)


def casadi_function_at_points(function: ca.Function, control: Array, p: Array) -> AtPoints:
    """Return the same, evaluated by casadi.

    Raises:
        KernelError: on a call, if the function reports a failure.
    """
    count = control.shape[1]
    mapped = dense(function).map(count)
    # one point after another, as casadi stores them
    given = (
        np.zeros((count, function.size1_in(0))),
        np.ascontiguousarray(control.T, dtype=np.float64),
        np.tile(p, (count, 1)),
    )
    found = np.zeros((count, function.size1_out(0)))
    buffer, evaluate = mapped.buffer()
    for place, array in enumerate(given):
        if array.size:
            buffer.set_arg(place, array.data)  # pyright: ignore[reportCallIssue] as in `points.py`
    buffer.set_res(0, found.data)  # pyright: ignore[reportCallIssue]

    def at(states: Array, owned: tuple[Array, ...] = given) -> Array:  # the buffer does not keep its arrays alive
        owned[0][:] = states.T
        evaluate()
        if buffer.ret():
            raise KernelError(f"{function.name()} could not be evaluated")
        return found.T.copy()  # of a single point the transpose is contiguous, and would be written over

    return at


SAMPLES = 10
"""The number of equal parts into which a replayed interval is sampled.

Of what a quantity exceeds its values at the nodes by between them, samples at tenths miss 1.2 % at most, at fifths 7 %
and at twentieths 0.3 %. This was measured against 200 samples on the optima of the hang glider and the heated
shuttle.
"""

RELATIVE_TOLERANCE = 1e-10
"""The tolerance of the replay from node to node, as a fraction of a state or of its scale.

On the same optima the defects of all intervals are then known to 1e-10 of the scales, four orders below what a
certificate allows; a tolerance of 1e-8 leaves errors of 6e-9 and takes hardly less time.
"""

SHORTER = 4
"""The number of steps that replace one when the shooting scheme estimates its own defect.

On the same optima the estimate is right within 0.1 % of the largest defect; with two steps it is right within 2.5 %.
"""

PHASE_TOLERANCE = 1e-7
"""The tolerance of the replay from phase to phase, for each of the intervals that follow one another.

It is a fraction of a state or of its scale, as the one above.

The shuttle's 120 intervals end within 5e-8 of the states' scales of where a tolerance of 1e-11 leads, which is 5 mm at
a scale of 100 km; 1e-6 leaves eight times as much and takes little less time.
"""

MOST_STEPS = 100
"""The number of steps that an interval may take, where those of all shipped courses take up to 5.

What needs more is no flight, but a number that somebody has put into a file.
"""


@record
class Replay:
    """A flight that was flown again by the independent integrator.

    Attributes:
        state: on a grid `SAMPLES` times finer than the mesh; shape (n_x, N, SAMPLES + 1), both ends included.
        path: path quantities on that grid; shape (n_c, N, SAMPLES + 1).
        defect: end of each replayed interval minus the next node, before any jump, in scaled units; shape (n_x, N).
    """

    state: Array
    path: Array
    defect: Array


def interval_durations(problem: Problem, durations: Array) -> Array:
    """Compute the duration of every interval from those of the phases, s; shapes (n,) -> (N,)."""
    parts = [np.asarray(phase.fractions) * T for phase, T in zip(problem.phases, durations, strict=True)]
    return np.concatenate(parts)


def replay(problem: Problem, iterate: Iterate) -> Replay:
    """Integrate every interval from its own node with its own control, by the independent integrator."""
    system = problem.system
    n_x, intervals = len(system.states), problem.intervals
    scale = np.array([quantity.scale for quantity in system.states])
    steps = interval_durations(problem, iterate.durations)
    rates = _rates(problem, iterate.control)

    def side_by_side(_: float, flat: Array) -> Array:
        return (rates(flat.reshape(n_x, intervals) * scale[:, None]) * steps / scale[:, None]).ravel()

    # The integrator weighs the mean error of all intervals; one of them may hold all of it.
    tolerance = RELATIVE_TOLERANCE / np.sqrt(intervals)
    start = (iterate.state[:, :-1] / scale[:, None]).ravel()
    grid = np.linspace(0.0, 1.0, SAMPLES + 1)
    relative = max(tolerance, 1e-13)
    histories = integrate(side_by_side, start, grid, relative=relative, absolute=tolerance, most_steps=MOST_STEPS)
    state = histories.reshape(n_x, intervals, SAMPLES + 1)
    defect = state[:, :, -1] - problem.states_before_jump(iterate.state) / scale[:, None]
    state = state * scale[:, None, None]
    return Replay(state, _path_values(problem, state, iterate.control), defect)


def estimate_defect(problem: Problem, iterate: Iterate) -> Array:
    """Estimate `Replay.defect` by the shooting scheme itself with shorter steps; scaled, shape (n_x, N).

    It takes a tenth of the time, and shares code with what it measures: enough to compare flights, not to certify one.
    """
    return (_stepped(problem, iterate, SHORTER) - problem.states_before_jump(iterate.state)) / _scale(problem)


def estimate_error(problem: Problem, iterate: Iterate) -> Array:
    """Estimate the scheme's own error in every interval, even if the nodes do not join; scaled, shape (n_x, N)."""
    return (_stepped(problem, iterate, SHORTER) - _stepped(problem, iterate, 1)) / _scale(problem)


def replay_phases(problem: Problem, iterate: Iterate) -> Array:
    """Measure how far each phase ends from its last node, before any jump, when it is flown in one go from its first.

    Returns:
        The end that is flown minus that node, in the states' units; shape (n_x, n phases).
    """
    first, ends = np.array(problem.first_node[:-1]), np.array(problem.first_node[1:])
    scale = _scale(problem)
    steps = interval_durations(problem, iterate.durations)
    x = iterate.state[:, first] / scale
    for number in range(int((ends - first).max())):
        flying = np.flatnonzero(first + number < ends)
        interval = first[flying] + number
        x[:, flying] = _across(problem, x[:, flying], iterate.control[:, interval], steps[interval])
    return x * scale - problem.states_before_jump(iterate.state)[:, ends - 1]


def _stepped(problem: Problem, iterate: Iterate, shorter: int) -> Array:
    """Return the ends of all intervals by the shooting scheme, with so many steps in place of one; shape (n_x, N)."""
    at = _rates(problem, iterate.control)
    scheme = dataclasses.replace(problem.scheme, steps=shorter * problem.scheme.steps)
    steps = interval_durations(problem, iterate.durations)

    def rates(x: Array, u: Array, p: Array) -> Array:
        return at(x)

    return scheme.advance(rates, iterate.state[:, :-1], iterate.control, np.asarray(problem.parameters), steps)


def _rates(problem: Problem, control: Array) -> AtPoints:
    return function_at_points(problem.system.rates, control, np.asarray(problem.parameters))


def _scale(problem: Problem) -> Array:
    """Return the scales of the states, shape (n_x, 1)."""
    return np.array([quantity.scale for quantity in problem.system.states])[:, None]


def _across(problem: Problem, x: Array, control: Array, steps: Array) -> Array:
    """Return scaled states (n_x, n) after so many seconds (n,) of held controls (n_u, n)."""
    scale = _scale(problem)
    rates = _rates(problem, control)

    def side_by_side(_: float, flat: Array) -> Array:
        return (rates(flat.reshape(x.shape) * scale) * steps / scale).ravel()

    whole = np.array([0.0, 1.0])
    tolerance = PHASE_TOLERANCE
    ends = integrate(
        side_by_side, x.ravel(), whole, relative=tolerance, absolute=tolerance, first_step=1.0, most_steps=MOST_STEPS
    )
    return ends[:, -1].reshape(x.shape)


def _path_values(problem: Problem, state: Array, control: Array) -> Array:
    """Return the path quantities along the replay, shape (n_c, N, SAMPLES + 1)."""
    system = problem.system
    n_x, intervals, samples = state.shape
    if system.path_values is None:
        return np.zeros((0, intervals, samples))
    held = np.repeat(control, samples, axis=1)
    values = function_at_points(system.path_values, held, np.asarray(problem.parameters))(
        state.reshape(n_x, intervals * samples)
    )
    return values.reshape(len(system.path), intervals, samples)


AGREEMENT = 1e-8
"""The largest difference, in the states' scales, between a sample and the same in half as many steps.

Its own error is then a hundred times smaller: on the shipped races samples differ by 5e-10 at most from those of
scipy's DOP853 at a tolerance of 1e-10.
"""
STEPS_MAX = 256
"""The largest number of steps to a sample; a flight that needs more of them between two nodes is none."""


def sample(system: System, parameters: Array, iterate: Iterate, *, time: Array, times: Array) -> Array:
    """Compute the states at any times of a flight.

    Args:
        system: what flies.
        parameters: its parameters, shape (n_p,).
        iterate: states at nodes and controls on intervals.
        time: of the nodes, s; shape (N + 1,).
        times: wanted, s, within the flight; shape (n,).

    Returns:
        The states, in their units; at the instant of a jump between phases the state after it. Shape (n_x, n). NaN
        where the rates cannot be integrated.
    """
    interval = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
    start, control, lengths = iterate.state[:, interval], iterate.control[:, interval], times - time[interval]
    scale = np.array([quantity.scale for quantity in system.states])[:, None]

    def flown(wanted: Indices, steps: int) -> Array:
        rates = function_at_points(system.rates, control[:, wanted], parameters)

        def held(x: Array, _: None, __: None) -> Array:
            return rates(x)

        with np.errstate(over="ignore", invalid="ignore"):  # of flights that are none
            return replace(VERNER_7, steps=steps).advance(held, start[:, wanted], None, None, lengths[wanted])

    apart, steps = np.arange(len(times)), 1
    samples = flown(apart, steps)
    while len(apart) and steps < STEPS_MAX:
        steps *= 2
        finer = flown(apart, steps)
        agreeing = (np.abs(finer - samples[:, apart]) <= AGREEMENT * scale).all(axis=0)
        lost = ~np.isfinite(finer).all(axis=0)
        samples[:, apart] = np.where(lost, np.nan, finer)
        apart = apart[~agreeing & ~lost]
    samples[:, apart] = np.nan
    return samples
