"""The race in rockit: direct multiple shooting with two steps of its Runge-Kutta scheme, solved by IPOPT.

As its examples do: one stage per leg, stitched by equalities of the states, free durations, and `expand`, which turns
the program into scalar operations. Two more options let IPOPT find its way on sixteen phases, where it ends after 1000
iterations without them: no limit is stated twice where legs meet (`include_first`, `include_last`), and casadi hands
limits of single variables on as such (`detect_simple_bounds`), as the engine's program does.
"""

import time
from typing import Any

import casadi as ca
import numpy as np

from peers.measured import Answer, Flight
from peers.race import Gate, Race, crossing

STEPS = 2  # of the integrator in a segment


def solve(race: Race, segments: int, tolerance: float) -> Answer:
    """Solve in this process with one thread.

    Raises:
        ImportError: rockit is not installed.
    """
    import rockit  # in the extra `peers`

    began, spent = time.perf_counter(), time.process_time()
    whole, guess = rockit.Ocp(), race.guess(segments)
    legs: list[tuple[Any, Any, Any]] = []
    for index, gate in enumerate(race.gates):
        leg, x, u = _leg(rockit, whole, race, gate, segments, float(guess.durations[index]))
        leg.set_initial(x, guess.states[index])
        leg.set_initial(u, guess.control)
        if legs:
            before, x_before, _ = legs[-1]
            whole.subject_to(leg.at_t0(x) == before.at_tf(x_before))
        else:
            whole.subject_to(leg.at_t0(x) == race.start)
        legs.append((leg, x, u))
    ipopt = {"tol": tolerance, "max_iter": 1000, "print_level": 0, "sb": "yes"}
    options = {"expand": True, "detect_simple_bounds": True, "print_time": False, "record_time": True}
    whole.solver("ipopt", options | {"ipopt": ipopt})
    try:
        solution, solved = whole.solve(), True
    except RuntimeError:  # that is how casadi tells that IPOPT did not converge
        solution, solved = whole.non_converged_solution, False
    took, used = time.perf_counter() - began, time.process_time() - spent
    stats = solution.stats
    solving = stats["t_wall_total"]
    return Answer(
        flight=_flight(solution, legs) if solved else None,
        status=stats["return_status"],
        iterations=stats["iter_count"],
        setup=took - solving,
        solve=solving,
        processor=used,
        processor_solve=stats["t_proc_total"],
    )


def _leg(rockit: Any, whole: Any, race: Race, gate: Gate, segments: int, duration: float) -> tuple[Any, Any, Any]:
    """One stage with its limits and its gate; returns it with its states and controls."""
    system = race.model.system
    leg = whole.stage(t0=0, T=rockit.FreeTime(duration))
    x = leg.state(len(system.states), scale=ca.DM([one.scale for one in system.states]))
    u = leg.control(len(system.controls), scale=ca.DM([one.scale for one in system.controls]))
    leg.set_der(x, ca.vertcat(*race.rates(ca.vertsplit(x), ca.vertsplit(u))))
    of_states = [*zip(system.states, ca.vertsplit(x), strict=True)]
    of_states += zip(system.path, race.coefficients(ca.vertsplit(x)), strict=True)
    for one, value in of_states:  # the first state is given, or the last one of the leg before
        _limit(leg, value, one.lower, one.upper, include_first=False)
    for one, value in zip(system.controls, ca.vertsplit(u), strict=True):  # at the end is that of the last segment
        _limit(leg, value, one.lower, one.upper, include_last=False)
    leg.subject_to(leg.at_tf(x[:3]) == ca.DM(gate.position))
    if gate.fixed:
        seen = crossing(ca.vertsplit(x)[4:8], float(np.cos(gate.heading)), float(np.sin(gate.heading)))
        leg.subject_to(leg.at_tf(ca.vertcat(*seen)) == 0)
    leg.subject_to(leg.T >= 0.1)
    leg.add_objective(leg.T)
    leg.method(rockit.MultipleShooting(N=segments, M=STEPS, intg="rk"))
    return leg, x, u


def _limit(leg: Any, value: Any, lower: float, upper: float, **where: bool) -> None:
    if np.isfinite(lower) and np.isfinite(upper):
        leg.subject_to(lower <= (value <= upper), **where)
    elif np.isfinite(upper):
        leg.subject_to(value <= upper, **where)
    elif np.isfinite(lower):
        leg.subject_to(value >= lower, **where)


def _flight(solution: Any, legs: list[tuple[Any, Any, Any]]) -> Flight:
    """Read the optimum."""
    states, controls, durations = [], [], []
    for leg, x, u in legs:
        times, sampled = solution(leg).sample(x, grid="control")
        states.append(np.array(sampled))
        controls.append(np.array(solution(leg).sample(u, grid="control")[1])[:-1])  # the last is told twice
        durations.append(float(times[-1] - times[0]))
    return Flight(
        durations=np.array(durations),
        starts=np.array([one[0] for one in states]).T,
        ends=np.array([one[-1] for one in states]).T,
        controls=np.array(controls).transpose(2, 0, 1),
    )
