"""The replay of an optimum: its controls integrated by an independent integrator, restarted at every node or phase.

scipy's DOP853 shares no code with the shooting scheme. It integrates the model's rates, see `function_at_points`; a
test holds the native ones against casadi's. Restarted at every node, all intervals are integrated side by side over
their own share of time, so one call serves a whole race; restarted at every phase, all phases side by side.
"""

import dataclasses
import importlib
import logging
import sys
import threading
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from airrace.errors import KernelError
from airrace.optimal_control.native.interpreter import interpreter
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.runge_kutta import VERNER_7
from airrace.optimal_control.system import System, at_points, dense
from airrace.optimal_control.trajectory import Array, Indices

ALIAS = "airrace_scipy_integrators"
"""The name under which the folder of integrators is loaded."""
FOLDER = Path("integrate", "_ivp")
"""The folder of the integrators in scipy, since its version 1.0."""


@cache
def dop853() -> Any:  # Any: untyped in scipy
    """Return scipy's class `DOP853`: from its own file, or from `scipy.integrate` where that file is elsewhere."""
    try:
        scipy = find_spec("scipy")
        if scipy is None or scipy.submodule_search_locations is None:
            raise ImportError("scipy is no package")
        package = ModuleType(ALIAS)
        package.__path__ = [str(Path(folder, FOLDER)) for folder in scipy.submodule_search_locations]
        sys.modules.setdefault(ALIAS, package)
        return importlib.import_module(f"{ALIAS}.rk").DOP853
    except (ImportError, AttributeError):
        return importlib.import_module("scipy.integrate").DOP853


@cache
def load_in_background() -> None:
    """Begin to load the integrator, once, while a solver process works."""
    threading.Thread(target=dop853, daemon=True).start()


class _TooManyStepsError(Exception):
    """More steps would be needed than were allowed."""


def integrate(
    rates: Callable[[float, Array], Array],
    start: Array,
    times: Array,
    *,
    relative: float,
    absolute: float,
    first_step: float | None = None,
    most_steps: int = 100_000,
) -> Array:
    """Integrate differential equations by the Runge-Kutta scheme DOP853 of orders 8, 5 and 3 [Hairer 1993, II.5].

    Args:
        rates: from the time and the state (m,) to the state's rates (m,).
        start: state at the first of the times, shape (m,).
        times: increasing, s; shape (n,).
        relative, absolute: tolerances of the error of a step, as a fraction of the state and in its units.
        first_step: length that is tried first, s; by default the integrator looks for one.
        most_steps: about how many steps are taken or tried at most.

    Returns:
        The states at these times, shape (m, n); NaN from where the integrator found no step that is small enough, and
        all of them where the start is not finite or more steps would be needed.
    """
    states, reached, evaluations = np.full((len(start), len(times)), np.nan), 1, 0
    if not np.isfinite(start).all():
        return states

    def count(time: float, state: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        if evaluations > most_steps * 12:  # evaluations of the rates in a step
            raise _TooManyStepsError
        return rates(time, state)

    try:
        with np.errstate(over="ignore", invalid="ignore"):  # rates that are no numbers shorten the step, until it fails
            solver = dop853()(count, times[0], start, times[-1], rtol=relative, atol=absolute, first_step=first_step)
            states[:, 0], status = start, "running"
            while status == "running":
                solver.step()
                status = str(solver.status)
                passed = int(np.searchsorted(times, float(solver.t), side="right"))
                if len(times) > 2 and passed > reached and status != "failed":
                    states[:, reached:passed] = solver.dense_output()(times[reached:passed])
                    reached = passed
            if len(times) == 2 and status == "finished":  # both ends are there without interpolation
                states[:, -1] = solver.y
    except _TooManyStepsError:
        states[:] = np.nan
    return states


logger = logging.getLogger(__name__)

SAMPLES = 10
"""The number of equal parts into which a replayed interval is sampled.

Of what a quantity exceeds its values at the nodes by between them, samples at tenths miss 1.2 % at most, at fifths 7 %
and at twentieths 0.3 %. This was measured against 200 samples on the optima of the hang glider and the heated
shuttle.
"""


@dataclasses.dataclass(frozen=True)
class ReplaySettings:
    """The accuracy of replays; tolerances are fractions of a state or of its scale.

    Attributes:
        tolerance: of the replay from node to node. On the optima of the hang glider and the heated shuttle the defects
            of all intervals are then known to 1e-10 of the scales, four orders below what a certificate allows; 1e-8
            leaves errors of 6e-9 and takes hardly less time.
        phase_tolerance: of the replay from phase to phase, for each of the intervals that follow one another. The
            shuttle's 120 intervals end within 5e-8 of where a tolerance of 1e-11 leads, which is 5 mm at a scale of
            100 km; 1e-6 leaves eight times as much and takes little less time.
        steps_max: that an interval may take, where those of all shipped courses take up to 5. What needs more is no
            flight, but a number from a file that was edited.
        shorter: the number of steps that replace one when the shooting scheme estimates its own defect. On the same
            optima the estimate is right within 0.1 % of the largest defect; with two steps within 2.5 %.
        agreement: the largest difference between a sample and the same in half as many steps. Its own error is then a
            hundred times smaller: on the shipped races samples differ by 5e-10 at most from DOP853's at 1e-10.
        sample_steps_max: the largest number of steps to a sample; a flight that needs more between two nodes is none.
    """

    tolerance: float = 1e-10
    phase_tolerance: float = 1e-7
    steps_max: int = 100
    shorter: int = 4
    agreement: float = 1e-8
    sample_steps_max: int = 256


SETTINGS = ReplaySettings()


@dataclasses.dataclass(frozen=True, eq=False)
class Replay:
    """A flight that was integrated again by the independent integrator.

    Attributes:
        state: on a grid `SAMPLES` times finer than the mesh; shape (n_x, N, SAMPLES + 1), both ends included.
        path: path quantities on that grid; shape (n_c, N, SAMPLES + 1).
        defect: end of each replayed interval minus the next node, before any jump, in scaled units; shape (n_x, N).
    """

    state: Array
    path: Array
    defect: Array


def function_at_points(function: ca.Function, control: Array, p: Array) -> Callable[[Array], Array]:
    """Return a function (x, u, p) -> values as a function from states (n_x, n) alone to values (n_v, n), a new array.

    Args:
        function: of SX, with one result.
        control, p: shapes (n_u, n), (n_p,).

    Raises:
        ValueError: on a call, if the states are not those of as many points as the controls.
    """
    parameters, dense_function = np.ascontiguousarray(p, dtype=np.float64), dense(function)
    native = interpreter()
    if native is not None:
        try:
            return native.at_points(dense_function, control, parameters)
        except KernelError as error:
            logger.info("casadi evaluates %s: %s", function.name(), error)
    return lambda states: at_points(dense_function, states, control, parameters)


def interval_durations(problem: Problem, durations: Array) -> Array:
    """Compute the duration of every interval from those of the phases, s; shapes (n,) -> (N,)."""
    parts = [np.asarray(phase.fractions) * T for phase, T in zip(problem.phases, durations, strict=True)]
    return np.concatenate(parts)


def replay(problem: Problem, iterate: Iterate) -> Replay:
    """Integrate every interval from its own node with its own control, by the independent integrator."""
    system, scale, intervals = problem.system, _scale(problem), problem.intervals
    # The integrator weighs the mean error of all intervals; one of them may hold all of it.
    tolerance = SETTINGS.tolerance / np.sqrt(intervals)
    scaled = _integrate_side_by_side(
        problem,
        iterate.state[:, :-1] / scale,
        iterate.control,
        interval_durations(problem, iterate.durations),
        np.linspace(0.0, 1.0, SAMPLES + 1),
        relative=max(tolerance, 1e-13),
        absolute=tolerance,
    )
    defect = scaled[:, :, -1] - problem.states_before_jump(iterate.state) / scale
    state = scaled * scale[:, :, None]
    if system.path_values is None:
        return Replay(state, np.zeros((0, intervals, SAMPLES + 1)), defect)
    control = np.repeat(iterate.control, SAMPLES + 1, axis=1)
    values = function_at_points(system.path_values, control, np.asarray(problem.parameters))(
        state.reshape(len(scale), control.shape[1])
    )
    return Replay(state, values.reshape(len(system.path), intervals, SAMPLES + 1), defect)


def replay_phases(problem: Problem, iterate: Iterate) -> Array:
    """Measure how far each phase ends from its last node, before any jump, when integrated in one go from its first.

    Returns:
        The integrated end minus that node, in the states' units; shape (n_x, n phases).
    """
    first, ends = np.array(problem.first_node[:-1]), np.array(problem.first_node[1:])
    scale, tolerance = _scale(problem), SETTINGS.phase_tolerance
    steps = interval_durations(problem, iterate.durations)
    x = iterate.state[:, first] / scale
    for number in range(int((ends - first).max())):
        flying = np.flatnonzero(first + number < ends)
        interval = first[flying] + number
        x[:, flying] = _integrate_side_by_side(
            problem,
            x[:, flying],
            iterate.control[:, interval],
            steps[interval],
            np.array([0.0, 1.0]),
            relative=tolerance,
            absolute=tolerance,
            first_step=1.0,
        )[:, :, -1]
    return x * scale - problem.states_before_jump(iterate.state)[:, ends - 1]


def _integrate_side_by_side(
    problem: Problem,
    start: Array,
    control: Array,
    seconds: Array,
    shares: Array,
    *,
    relative: float,
    absolute: float,
    first_step: float | None = None,
) -> Array:
    """Return scaled states (n_x, n, m) at shares (m,) of so many seconds (n,) of held controls (n_u, n)."""
    scale = _scale(problem)
    rates = function_at_points(problem.system.rates, control, np.asarray(problem.parameters))

    def scaled_rates(_: float, flat: Array) -> Array:
        return (rates(flat.reshape(start.shape) * scale) * seconds / scale).ravel()

    histories = integrate(
        scaled_rates,
        start.ravel(),
        shares,
        relative=relative,
        absolute=absolute,
        first_step=first_step,
        most_steps=SETTINGS.steps_max,
    )
    return histories.reshape(*start.shape, len(shares))


def estimate_defect(problem: Problem, iterate: Iterate) -> Array:
    """Estimate `Replay.defect` by the shooting scheme itself with shorter steps; scaled, shape (n_x, N).

    It takes a tenth of the time, and shares code with what it measures: enough to compare flights, not to certify one.
    """
    before = problem.states_before_jump(iterate.state)
    return (_advance(problem, iterate, SETTINGS.shorter) - before) / _scale(problem)


def estimate_error(problem: Problem, iterate: Iterate) -> Array:
    """Estimate the scheme's own error in every interval, even if the nodes do not join; scaled, shape (n_x, N)."""
    return (_advance(problem, iterate, SETTINGS.shorter) - _advance(problem, iterate, 1)) / _scale(problem)


def _advance(problem: Problem, iterate: Iterate, shorter: int) -> Array:
    """Return the ends of all intervals by the shooting scheme, with so many steps in place of one; shape (n_x, N)."""
    p, steps = np.asarray(problem.parameters), interval_durations(problem, iterate.durations)
    rates = function_at_points(problem.system.rates, iterate.control, p)
    scheme = dataclasses.replace(problem.scheme, steps=shorter * problem.scheme.steps)
    return scheme.advance(lambda x, _, __: rates(x), iterate.state[:, :-1], iterate.control, p, steps)


def _scale(problem: Problem) -> Array:
    """Return the scales of the states, shape (n_x, 1)."""
    return np.array([quantity.scale for quantity in problem.system.states])[:, None]


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

    def advance(intervals: Indices, steps: int) -> Array:
        rates = function_at_points(system.rates, control[:, intervals], parameters)
        scheme = dataclasses.replace(VERNER_7, steps=steps)
        with np.errstate(over="ignore", invalid="ignore"):  # of flights that are none
            return scheme.advance(lambda x, _, __: rates(x), start[:, intervals], None, None, lengths[intervals])

    apart, steps = np.arange(len(times)), 1
    samples = advance(apart, steps)
    while len(apart) and steps < SETTINGS.sample_steps_max:
        steps *= 2
        finer = advance(apart, steps)
        agreeing = (np.abs(finer - samples[:, apart]) <= SETTINGS.agreement * scale).all(axis=0)
        lost = ~np.isfinite(finer).all(axis=0)
        samples[:, apart] = np.where(lost, np.nan, finer)
        apart = apart[~agreeing & ~lost]
    samples[:, apart] = np.nan
    return samples
