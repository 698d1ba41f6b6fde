"""The cost to go measured: along optima, for planted mistakes of known cost, and its speed beside whole races.

    python scripts/experiments/cost_to_go.py along RUN.h5:STAGE ...
    python scripts/experiments/cost_to_go.py mistakes RUN.h5 ...
    python scripts/experiments/cost_to_go.py speed RUN.h5:STAGE [STATES]

`along`: the largest |V(x(t)) + t - T| on the nodes of an optimum. `mistakes`: the optimum up to a moment, then one thing
done badly and everything behind it as well as can be, solved whole by the ordinary problem: its loss is T' - T. `speed`:
states of flights that stray from the optimum as in noise, with guidance of three gates and to the finish.
"""

import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from airrace.optimal_control.problem import Boundary, Iterate
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.interface import SolverOptions
from airrace.procedure.cost_to_go import new_service
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.runs.cost_to_go import cost_to_go_of
from airrace.runs.run_state import open_run

NOISE = {"x": 4.0, "y": 4.0, "z": 3.0, "V_K": 1.5}
"""Standard deviations of states, m and m/s."""


LATE = 0.2
"""The time for which a roll does not begin, s."""


def opened(name):
    path, _, stage = name.partition(":")
    run = open_run(Path(path))
    view = run.stage(stage or None)
    return run, view, cost_to_go_of(view)


def state_of(trajectory, node):
    return {quantity.name: float(trajectory[quantity.name][node]) for quantity in trajectory.states}


def leg_of(trajectory, node):
    return int(np.searchsorted(trajectory.first_node, node, side="right")) - 1


def session_of(view, service):
    return closing(SolverSession(service, view.inputs.settings, Silent()))


def along(names):
    print("flight                          states  max |V+t-T| ms  relaxed  unsolved  median iterations")
    for name in names:
        _, view, rest = opened(name)
        trajectory = view.result.trajectory
        last = len(trajectory.time) - 2
        nodes = sorted({*trajectory.first_node.tolist()[:-1], *range(0, last, max(1, last // 40))})
        errors, relaxed, unsolved, iterations = [], 0, 0, []
        with new_service(1) as service, session_of(view, service) as session:
            for node in nodes:
                answer = rest.solve(session, state_of(trajectory, node), leg_of(trajectory, node))
                errors.append(1e3 * (answer.cost + trajectory.time[node] - trajectory.race_time))
                relaxed += answer.relaxed > 1e-3
                unsolved += not answer.solved
                iterations.append(answer.iterations)
        worst = np.abs(errors).max()
        print(
            f"{Path(name).name:30s} {len(nodes):7d} {worst:15.3f} {relaxed:8d} {unsolved:9d} {np.median(iterations):8.0f}"
        )
        sys.stdout.flush()


def pieces(trajectory, leg):
    """Return the mistakes on a leg: name, first node, nodes of the piece, bounds within it, bounds at its end."""
    first, end = trajectory.first_node[leg : leg + 2].tolist()
    t, p, n_z, z = trajectory.time, trajectory["p_Kbar"], trajectory["n_z"], trajectory["z"]
    rolls = first + np.flatnonzero(np.abs(p[first:end]) > 0.5)
    slow = min(first + max(1, int(np.searchsorted(t[first:end] - t[first], 0.6))), end - 1)
    yield "slow entry", first, slow, {"delta_T_cmd": Interval(0.0, 0.3)}, {}
    middle = (first + end) // 2
    yield "climb", first, middle, {}, {"z": Interval(upper=float(z[middle]) - 6.0)}
    peak = float(n_z[first:end].max())
    if peak > 4.0 and n_z[first] < 0.75 * peak:
        yield "wide turn", first, end, {"n_z": Interval(-2.0, 0.8 * peak)}, {}
    for roll in rolls.tolist():
        node = roll - 1  # the last one at which the roll has not begun
        if node > first and abs(p[node]) < 0.5:
            last = node + int(np.searchsorted(t[node:end] - t[node], LATE))
            if node < last < end:
                yield "late roll", node, last, {"p_Kbar": Interval(-0.6, 0.6)}, {}


def with_piece(problem, guess, count, bounds, end, seconds):
    """Return a problem whose first so many intervals are a phase of their own with bounds of its own."""
    first = problem.phases[0]
    if count == len(first.fractions):
        phase = replace(first, bounds={**first.bounds, **bounds})
        return replace(problem, phases=(phase, *problem.phases[1:])), guess
    share = sum(first.fractions[:count])
    duration = Interval(0.0, first.duration.upper) if seconds is None else Interval.exactly(seconds)
    piece = replace(
        first.part(slice(0, count)), bounds={**first.bounds, **bounds}, duration=duration, end=Boundary("", end)
    )
    behind = replace(first.part(slice(count, None)), duration=Interval(0.0, first.duration.upper))
    durations = np.concatenate([guess.durations[:1] * [share, 1.0 - share], guess.durations[1:]])
    return replace(problem, phases=(piece, behind, *problem.phases[1:])), Iterate(durations, guess.state, guess.control)


def mistakes(names):
    print("run                   mistake     leg   cost s   found in its leg s   error %   sum of all - (T' - T) us")
    for name in names:
        _, view, rest = opened(f"{name}:point-mass")
        trajectory, done = view.result.trajectory, set()
        with new_service(1) as service, session_of(view, service) as session:
            for leg in range(1, len(trajectory.durations) - 1):
                for kind, node, last, bounds, end in pieces(trajectory, leg):
                    if kind not in done and plant(rest, session, Path(name).stem, (kind, leg, node, last, bounds, end)):
                        done.add(kind)


def plant(rest, session, name, mistake):
    kind, leg, node, last, bounds, end = mistake
    optimum = rest.optimum
    problem, guess, _ = rest._rest(leg, float(optimum.time[node]), len(rest.problem.phases))
    start = fixed_state(rest.flight, optimum.state[:, node])
    seconds = float(optimum.time[last] - optimum.time[node]) if kind in ("slow entry", "late roll") else None
    if kind == "late roll":
        seconds = LATE
    problem, guess = with_piece(replace(problem, start=start), guess, last - node, bounds, end, seconds)
    options = SolverOptions(1e-7, 150, 1e-3, curvature=False)
    solution = session.attempt(problem, guess, kind, "interior-point", options, beyond_budget=True)
    if solution is None or not solution.success:
        return False
    flown, cost = solution.iterate, float(solution.iterate.durations.sum()) + optimum.time[node] - optimum.race_time
    if cost < 0.01:
        return False
    steps = np.concatenate([d * np.array(f.fractions) for d, f in zip(flown.durations, problem.phases)])
    times = optimum.time[node] + np.concatenate([[0.0], np.cumsum(steps)])
    reachable = [optimum.race_time] * (leg + 1)  # as the optimum up to the piece
    names = [state.name for state in optimum.states]
    unsolved = 0
    for number in range(leg + 1, len(optimum.durations)):
        row = int(optimum.first_node[number]) - node
        answer = rest.solve(session, dict(zip(names, flown.state[:, row].tolist())), number)
        unsolved += not answer.solved or answer.relaxed > 1e-3
        reachable.append(float(times[row]) + answer.cost)
    reachable.append(float(times[-1]))
    losses = np.diff(reachable)
    error = 100.0 * (losses[leg] / cost - 1.0)
    exact = 1e6 * (losses.sum() - cost)
    print(
        f"{name:20s} {kind:11s} {leg:4d} {cost:9.4f} {losses[leg]:14.4f} {error:14.2f} {exact:14.1f}   {unsolved} unsolved"
    )
    sys.stdout.flush()
    return True


def speed(name, count):
    _, view, rest = opened(name)
    trajectory, generator = view.result.trajectory, np.random.default_rng(0)
    nodes = generator.integers(0, len(trajectory.time) - 2, count).tolist()
    print("horizon      states  median s  99 % s  median solver s  unsolved  relaxed  iterations median, most")
    for gates in (3, None):
        seconds, solver, unsolved, relaxed, iterations = [], [], 0, 0, []
        with new_service(1) as service, session_of(view, service) as session:
            for node in nodes:
                state = state_of(trajectory, node)
                for key, deviation in NOISE.items():
                    state[key] += deviation * generator.normal()
                began = time.perf_counter()
                answer = rest.solve(session, state, leg_of(trajectory, node), deviations=NOISE, gates=gates)
                seconds.append(time.perf_counter() - began)
                solver.append(answer.seconds)
                unsolved += not answer.solved
                relaxed += answer.relaxed > 0.02
                iterations.append(answer.iterations)
        middle, late = np.percentile(seconds, [50.0, 99.0])
        print(
            f"{gates or 'finish':>7} {count:11d} {middle:9.3f} {late:7.3f} {np.median(solver):12.3f} {unsolved:13d} "
            f"{relaxed:8d} {np.median(iterations):10.0f} {max(iterations):5d}"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    command, *arguments = sys.argv[1:]
    if command == "along":
        along(arguments)
    elif command == "mistakes":
        mistakes(arguments)
    elif command == "speed":
        speed(arguments[0], int(arguments[1]) if len(arguments) > 1 else 500)
