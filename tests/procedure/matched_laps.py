"""Laps around an oval: as a race, and with ends that match, so that they can be flown any number of times."""

import dataclasses
import functools

import numpy as np
from races import EDGE_540, PLAN, course, level, optimum, prepared

from airrace.model.environment import Air
from airrace.model.track.course import ClearanceRule
from airrace.optimal_control.certificate import Item
from airrace.optimal_control.problem import Boundary, Problem
from airrace.optimal_control.quantities import Interval
from airrace.optimal_control.solvers.service import SolverService
from airrace.optimal_control.solvers.solver import ProgramSolution
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure.certification import examine
from airrace.procedure.fidelity import iterate_of
from airrace.procedure.guess import concatenate, phase_piece
from airrace.procedure.homotopy import fixed_state
from airrace.procedure.result import Silent
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage_problem import mesh_of, trajectory_of
from airrace.procedure.warm_start import InitialBarrier
from airrace.race import Race

OVAL = [level("south", 0.0, 0.0, 0.0), level("north", 150.0, 330.0, 180.0)]


def laps(count: int) -> Race:
    """An oval between two gates, `count` times around."""
    south, north = OVAL
    flown = course("oval", *[south, north] * count, south)
    names = [f"{index}:{passage.element.name}" for index, passage in enumerate(flown.passages)]
    passages = tuple(
        dataclasses.replace(passage, name=name) for passage, name in zip(flown.passages, names, strict=True)
    )
    rules = dataclasses.replace(flown.rules, clearance=ClearanceRule.CROSSING)  # ends that match know no pylons
    return Race(dataclasses.replace(flown, passages=passages, rules=rules), EDGE_540, Air())


FOUR = laps(4)


@functools.cache
def matched_laps(count: int) -> Trajectory:
    """The fastest laps that begin and end as a race of four laps passes the line after its second; certified.

    One lap starts from the third of that race. More start from the one flown as often, on its mesh: what they gain is
    no matter of meshes, and what they start from is allowed.
    """
    stage_problem, state = prepared(laps(count)), passing()
    source, race, used = (FOUR, optimum(FOUR, PLAN).trajectory, [4, 5])
    if count > 1:
        source, race, used = laps(1), matched_laps(1), [0, 1] * count
    mesh = mesh_of(race)
    whole = prepared(source).problem(mesh)
    start = concatenate([phase_piece(iterate_of(race), whole, phase) for phase in used])
    free = stage_problem.problem([mesh[phase] for phase in used])
    last = dataclasses.replace(
        free.phases[-1], end=matched(fixed_state(stage_problem, state), start.state[:, -1], state)
    )
    problem = dataclasses.replace(free, start=fixed_state(stage_problem, state), phases=(*free.phases[:-1], last))
    with SolverService(threads=1, stall_seconds=PLAN.solver.stall_seconds) as service:
        solution = SolverSession(service, PLAN, Silent()).solve(
            problem, start, "matched laps", barrier=InitialBarrier.PIECES
        )
    assert solution is not None
    assert solution.kkt.largest < PLAN.certificate.kkt_error
    assert not violations_of(problem, solution)
    return trajectory_of(problem, solution.iterate)


def passing() -> Array:
    """The state in which a race of four laps passes the line after its second; as a start it would be allowed."""
    race = optimum(FOUR, PLAN).trajectory
    state = race.state[:, race.first_node[4]]
    assert state[3] < race.state[3, 0]  # the speed
    return state


def violations_of(problem: Problem, solution: ProgramSolution) -> tuple[Item, ...]:
    """What the optimum violates, between nodes and at gates."""
    measured = examine(problem, solution.iterate, solution.multipliers.constraints, PLAN.certificate).check
    return tuple(item for item in measured.items if item.name != "replay_defect" and not item.holds)


def matched(end: Boundary, guess: Array, state: Array) -> Boundary:
    """The end of a lap: attitudes are the same with either sign, and three parts of a unit quaternion say it all."""
    attitude = [f"q{index}" for index in range(4)]
    rows = {name: row for row, name in enumerate(end.bounds)}
    sign = np.sign(sum(guess[rows[name]] * state[rows[name]] for name in attitude))
    largest = max(attitude, key=lambda name: abs(state[rows[name]]))
    exact = {
        name: Interval.exactly(sign * bounds.lower) if name in attitude else bounds
        for name, bounds in end.bounds.items()
        if name != largest
    }
    return dataclasses.replace(end, bounds=exact)
