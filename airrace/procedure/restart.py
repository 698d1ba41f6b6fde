"""The start of a stage from its optimum in another run, whose numbers were a little different.

The other run's flight is solved again under this race's numbers, on the two meshes that it was certified on: first on
the coarser one, from the stored flight; then on the finer one, from the stored flight moved by what the first solve
has changed, with more intervals where that guess lets expect errors of integration. Of a flight that was solved on
one mesh only, all intervals are halved first that its coarser mesh has as well. No model is simulated for that, no mesh
is looked for and no lower stage is solved. Where the certificate does not hold on these meshes, they are refined as
always.

Meanwhile a search around the stored flight, by the point mass, looks for a faster route. Its legs are refined by the
point mass, followed by the stage's model, and put into the stored flight.
"""

import functools
import itertools
import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from airrace.errors import UsageError
from airrace.model.track.course import Course
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.mesh_proposals import MeshProposal, bisect_coarse, refine_guess
from airrace.optimal_control.mesh_refinement import restrict
from airrace.optimal_control.problem import Iterate
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.solvers.service import SolverPool
from airrace.optimal_control.trajectory import Array
from airrace.procedure.choice import fastest_of, simplest_of, with_note_on_faster
from airrace.procedure.formulation import ensure_same_passings
from airrace.procedure.guess import concatenate, phase_piece
from airrace.procedure.mesh_check import check_mesh
from airrace.procedure.mesh_loop import (
    Failure,
    MeshGoal,
    MeshStrategy,
    MeshTask,
    carry_multipliers,
    next_until_certified,
    refine,
    solve_from_starts,
    solve_on_mesh,
    task_to_certify,
)
from airrace.procedure.multistart.multistart import RoutesAround, search_around
from airrace.procedure.pylon_sides import with_other_sides
from airrace.procedure.result import NOT_SEARCHED, OPTIMUM, Route, StageProvenance, StageResult
from airrace.procedure.settings import SearchEffort
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_models import StageModels, start_along
from airrace.procedure.stage_problem import StageProblem, coarse_mesh, mesh_of
from airrace.procedure.warm_start import InitialBarrier, Start

ITERATIONS_MAX = 60
"""The largest number of iterations of the first solve.

Starts that led to an optimum took 4 to 60. One that takes more is lost: the point mass is the better start, and so the
run takes no longer than from scratch.
"""


@dataclass(frozen=True)
class SourceRun:
    """Another run, under its name for users, with its stages."""

    name: str
    results: Sequence[StageResult]

    def optima(self, stages: Sequence[Stage]) -> list[StageResult]:
        """Its optima of these stages that hold, certified or solved on one mesh, the highest first."""
        results = [result for result in self.results if result.holds and result.stage in stages]
        return sorted(results, key=lambda result: stages.index(result.stage), reverse=True)

    def usable_optima(self, stages: Sequence[Stage]) -> list[StageResult]:
        """Return the optima that a run up to the last of these stages can be started from, the highest first.

        Raises:
            UsageError: there is none.
        """
        optima = self.optima(stages)
        if not optima:
            raise UsageError(f"{self.name} has no certified or solved stage up to {stages[-1].value} to start from")
        return optima


def starting_points(source: SourceRun, stages: Sequence[Stage], course: Course) -> list[StageResult]:
    """Return the optima of another run that this course can be started from, highest first.

    Raises:
        UsageError: there is none, or they fly other passings.
    """
    optima = source.usable_optima(stages)
    passings = [(passage.name, "") for passage in course.passages]
    for optimum in optima:
        ensure_same_passings(passings, [(split.name, "") for split in optimum.splits], source.name)
    return optima


def start_from(
    source: SourceRun,
    stages: Sequence[Stage],
    models: StageModels,
    session: SolverSession,
    point_mass_strategy: MeshStrategy,
) -> tuple[StageResult | None, str]:
    """Solve the highest of these stages from another run's optimum of it, and on a faster route if there is one near.

    The alternatives of that optimum are solved likewise, for another one may have become the fastest. Where none leads
    to an optimum, the run continues from the point mass's best route around it.

    Args:
        source: the other run.
        stages: in the order of rising fidelity, up to the highest one.
        models: of this race.
        session: solves.
        point_mass_strategy: how closely the point mass is solved.

    Returns:
        The fastest of these optima, as many slower ones as there were alternatives beside it; else that of the point
        mass; None without a start. And one sentence for users where it is not the highest stage on the stored route,
        else empty.

    Raises:
        UsageError: the other run has no optimum of these stages that holds, or flies other passings.
    """
    obstacles: list[tuple[Stage, str]] = []
    for optimum in starting_points(source, stages, models.race.course):
        obstacle = _obstacle(models, optimum)
        if not obstacle:
            break
        obstacles.append((optimum.stage, obstacle))
    else:
        return None, _remark(source, obstacles, "the start is from scratch")
    session.progress.stage_started(optimum.stage)
    models.preload(optimum.stage, session.service)
    usable = (optimum, *(alternative for alternative in optimum.alternatives if not _obstacle(models, alternative)))
    stored = usable[: session.settings.alternatives]
    with session.search_in_background(functools.partial(_search_around, models, session, optimum)) as search:
        main, *alternatives = [_from_optimum(models, session, start, source.name) for start in stored]
        around = search.result()
    flights = [flight for flight in (main, *alternatives) if isinstance(flight, StageResult)]
    faster = None
    if isinstance(main, str):
        obstacles.append((optimum.stage, main))
        consequence = "the start is an alternative of that"
    else:
        consequence = f"the start is its {optimum.stage.value}"
        if around is not None and around.phases:
            faster = _on_other_route(models, session, main, around, source.name, point_mass_strategy)
            flights += [faster] if faster else []
    if flights:
        remark = _remark(source, obstacles, consequence)
        restarted = RestartedFlights(source.name, flights, main, faster, around, len(stored) - 1)
        return _fastest(models, session, restarted, remark)
    if around is not None:
        point_mass = _refine_route(around, session, point_mass_strategy)
        if point_mass.holds:
            point_mass = replace(point_mass, search=around.report)
            return point_mass, _remark(source, obstacles, "the start is what the point mass makes of it")
    return None, _remark(source, obstacles, "the start is from scratch")


@dataclass(frozen=True)
class RestartedFlights:
    """The flights of a stage that was started from another run.

    Attributes:
        source: the name of that run.
        flights: all optima.
        main: that of the stored flight, or the reason why there is none.
        faster: on the faster route around it, if there is one.
        around: the routes around it; None without a search.
        alternatives: number of slower ones that are stored.
    """

    source: str
    flights: Sequence[StageResult]
    main: StageResult | str
    faster: StageResult | None
    around: RoutesAround | None
    alternatives: int

    def route_of(self, flight: StageResult) -> str:
        """Return which route a flight takes, in words."""
        if flight is self.main:
            return "the stored one"
        if not any(flight is source_flight for source_flight in self.flights):
            return "past a pylon on its other side"
        return self.around.text if self.around and flight is self.faster else "an alternative of the stored one"


def _fastest(
    models: StageModels, session: SolverSession, restarted: RestartedFlights, remark: str
) -> tuple[StageResult, str]:
    """Return the flight that is chosen, with slower ones as its alternatives, and the remark on the start."""
    stage_problem, main, around = models.problem(restarted.flights[0].stage), restarted.main, restarted.around
    flights = with_other_sides(models, restarted.flights, session)
    best = simplest_of(stage_problem, flights)
    slower = sorted(
        (slower_flight for slower_flight in flights if slower_flight is not best),
        key=lambda slower_flight: slower_flight.trajectory.race_time,
    )
    carried, log = tuple(slower[: restarted.alternatives]), tuple(session.attempts)
    if best is not main and not isinstance(main, str):
        is_faster = best.trajectory.race_time < main.trajectory.race_time
        what = "has become faster" if is_faster else "is simpler to fly and hardly slower"
        change = f"{restarted.source}: another route {what}: {restarted.route_of(best)}"
        remark = f"{remark}; {change}" if remark else change
    # Past a pylon on its other side it is on the route of the fastest flight before.
    on_route = (
        best if any(best is source_flight for source_flight in restarted.flights) else fastest_of(restarted.flights)
    )
    if around is not None and (on_route is main or on_route is restarted.faster):
        report = around.report if on_route is restarted.faster else around.report_on_stored
    else:  # the search was around the stored flight, if there was one: only these optima are comparable
        routes: list[Route] = []
        for optimum in (best, *slower):
            time = optimum.trajectory.race_time
            routes.append(Route(restarted.route_of(optimum), time, time - best.trajectory.race_time, OPTIMUM))
        report = replace(NOT_SEARCHED, routes=tuple(routes) if slower else ())
    best = with_note_on_faster(stage_problem, best, flights)
    return replace(best, alternatives=carried, attempts=log, timings=session.timings(), search=report), remark


def _search_around(
    models: StageModels, session: SolverSession, optimum: StageResult, pool: SolverPool
) -> RoutesAround | None:
    """Search around another run's optimum for a faster route; None without a search.

    It starts from the optimum as solved by the point mass under this race's numbers, so it does not depend on the
    solves that run meanwhile.
    """
    if session.settings.search is SearchEffort.OFF:
        return None
    point_mass, source = models.problem(Stage.POINT_MASS), models.problem_along(optimum.stage, optimum)
    return search_around(point_mass, source, optimum, models.race.course, session.settings.mesh, pool)


def _refine_route(around: RoutesAround, session: SolverSession, point_mass_strategy: MeshStrategy) -> StageResult:
    """Return the point mass's optimum on the best route that was found around a flight."""
    best = around.best
    start = Start(best.stage_problem, best.problem, best.iterate, InitialBarrier.COARSE, multipliers=best.multipliers)
    return solve_from_starts(session, [lambda: start], point_mass_strategy)


def _on_other_route(
    models: StageModels,
    session: SolverSession,
    continued: StageResult,
    around: RoutesAround,
    name: str,
    point_mass_strategy: MeshStrategy,
) -> StageResult | None:
    """Return the optimum of a stage from an optimum with a few legs on a faster route; None if none is certified."""
    point_mass = _refine_route(around, session, point_mass_strategy)
    if continued.stage is Stage.POINT_MASS:
        point_mass = check_mesh(models, point_mass, session)
        return point_mass if point_mass.certified else None
    if not point_mass.holds:
        return None
    whole = start_along(models, session, continued.stage, point_mass)
    start = replace(_splice(whole, continued, around.phases, name), iterations_max=ITERATIONS_MAX)
    proposal, primary = MeshProposal.first(start.problem, start.guess), session.solvers[0]
    first = task_to_certify(session, start.stage_problem, proposal, start.barrier, (primary,), None)
    result = refine(session, start, replace(first, purpose="on another route"), next_until_certified)
    return result if isinstance(result, StageResult) and result.certified else None


def _splice(whole: Start, optimum: StageResult, phases: Set[int], name: str) -> Start:
    """Return a start with some phases as given, and the others as in an optimum on another route."""
    mesh, stored = coarse_mesh(optimum)
    stored_problem = whole.stage_problem.problem(mesh)
    sources = [
        (whole.guess, whole.problem) if index in phases else (stored, stored_problem) for index in range(len(mesh))
    ]
    mesh = [problem.phases[index].fractions for index, (_, problem) in enumerate(sources)]
    guess = concatenate([phase_piece(guess, problem, index) for index, (guess, problem) in enumerate(sources)])
    provenance = StageProvenance(source_stage=optimum.stage.value, source_run=name)
    return replace(
        whole, problem=whole.stage_problem.problem(mesh), guess=guess, provenance=provenance, multipliers=None
    )


def _remark(source: SourceRun, obstacles: Sequence[tuple[Stage, str]], consequence: str) -> str:
    """Return a sentence on the failed starts and the one that replaced them; empty without a failure."""
    reasons = [
        f"from its {', '.join(stage.value for stage, _ in group)}, {reason}"
        for reason, group in itertools.groupby(obstacles, key=lambda obstacle: obstacle[1])
    ]
    return f"{source.name}: {'; '.join(reasons)}; so {consequence}" if reasons else ""


def _from_optimum(models: StageModels, session: SolverSession, optimum: StageResult, name: str) -> StageResult | str:
    """Return the certified optimum of a stage, started from a stored one; or a clause that says why there is none."""
    stored = _in_order_of(models.problem(optimum.stage), optimum)
    assert stored is not None  # there would be an obstacle
    stage_problem = models.problem_along(optimum.stage, optimum)
    start, finer = _start(stage_problem, optimum, stored, name)
    primary = session.solvers[0]
    reference = MeshTask(
        stage_problem,
        MeshProposal.first(start.problem, start.guess),
        start.barrier,
        (primary,),
        start.multipliers,
        number=-1,
        goal=MeshGoal.REFERENCE,
        purpose=f"from {start.provenance.source}",
    )
    coarse = solve_on_mesh(session, start, reference, ITERATIONS_MAX)
    if isinstance(coarse, Failure):
        status = session.attempts[-1].status if coarse.solution is None else coarse.solution.status
        return f"{primary} found no optimum ({status})"
    if finer is None:  # the usual refinement of the only stored mesh
        proposal, multipliers = MeshProposal.first(start.problem, coarse.optimum.iterate), coarse.solution.multipliers
        number, coarser = 0, None
    else:
        proposal = replace(finer, guess=_carry_change(finer, start.guess, coarse.optimum.iterate))
        proposal = refine_guess(proposal, stage_problem.problem(proposal.mesh), session.settings.certificate)
        multipliers = coarse.carry(proposal)
        number, coarser = min(1, session.settings.mesh.refinements_max), coarse.optimum
    first = task_to_certify(
        session,
        stage_problem,
        proposal,
        InitialBarrier.OTHER_MESH,
        (primary,),
        multipliers,
        number=number,
        before=coarse.optimum,
        coarser=coarser,
    )
    result = refine(session, start, first, next_until_certified, first_intervals=start.problem.intervals)
    if isinstance(result, Failure):
        return f"{primary} found no optimum on a finer mesh"
    return result if result.certified else f"the optimum was {result.message or 'not certified'}"


def _obstacle(models: StageModels, optimum: StageResult) -> str:
    """Return a clause that says why no stage can be started from an optimum; empty if one can."""
    if _in_order_of(models.problem(optimum.stage), optimum) is None:
        return "which flies other equations, no start was made"
    if other_way := _other_way(models.problem_along(optimum.stage, optimum), optimum):
        return f"which passes {other_way} the other way than is planned now, no start was made"
    return ""


def _other_way(stage_problem: StageProblem, optimum: StageResult) -> str:
    """Return the first gate or pylon that is planned to be crossed, or banked in, unlike in the stored flight.

    It is empty if there is none. Conditions at a passing are those of the planned direction, so no solver could lead
    from the one to the other.
    """
    for waypoint, split in zip(stage_problem.plan.waypoints, optimum.splits, strict=True):
        if not waypoint.passage.element.stands:
            continue
        banked = waypoint.bank is not None and math.cos(split.bank - waypoint.bank) < 0.0
        if banked or math.cos(split.heading - waypoint.axis) < 0.0:
            return split.name
    return ""


def _start(
    stage_problem: StageProblem, optimum: StageResult, stored: Iterate, name: str
) -> tuple[Start, MeshProposal | None]:
    """Return the stored flight on the coarser of its meshes, and on a finer one; None where only one is known."""
    mesh, nodes, finer = mesh_of(optimum.trajectory), optimum.coarser_nodes, None
    whole = stage_problem.problem(mesh)
    if not nodes.all() and nodes[optimum.trajectory.first_node].all():
        finer = bisect_coarse(MeshProposal(mesh, stored, optimum.mesh.why, nodes))
        mesh, stored = restrict(mesh, stored, nodes)
    problem, layout = stage_problem.problem(mesh), Layout(whole)
    multipliers = Multipliers(optimum.constraint_multipliers, optimum.bound_multipliers)
    if multipliers.constraints.shape == (layout.constraints,) and multipliers.bounds.shape == (layout.unknowns,):
        multipliers = carry_multipliers(multipliers, whole, problem)
    else:
        multipliers = None  # they belong to other limits
    provenance = StageProvenance(source_stage=optimum.stage.value, source_run=name)
    return Start(stage_problem, problem, stored, InitialBarrier.OTHER_MESH, provenance, multipliers), finer


def _carry_change(finer: MeshProposal, before: Iterate, after: Iterate) -> Iterate:
    """Return the flight on the finer mesh, shifted by the change of a solve on the coarser one."""
    places = np.flatnonzero(finer.coarser)
    passed = np.concatenate([[0.0], np.cumsum(np.concatenate(finer.mesh))])  # each phase counts 1
    changed: list[Array] = [np.interp(passed, passed[places], row) for row in after.state - before.state]
    parent = np.cumsum(finer.coarser[:-1]) - 1
    return Iterate(
        finer.guess.durations + after.durations - before.durations,
        finer.guess.state + np.stack(changed),
        finer.guess.control + (after.control - before.control)[:, parent],
    )


def _in_order_of(stage_problem: StageProblem, optimum: StageResult) -> Iterate | None:
    """Return the stored flight with the states and controls of a model, by names and units; None where they differ."""
    system, trajectory = stage_problem.model.system, optimum.trajectory
    rows: list[Array] = []
    for quantities, stored, values in (
        (system.states, trajectory.states, trajectory.state),
        (system.controls, trajectory.controls, trajectory.control),
    ):
        place = {(quantity.name, quantity.unit): row for row, quantity in enumerate(stored)}
        keys = [(quantity.name, quantity.unit) for quantity in quantities]
        if set(keys) != set(place):
            return None
        rows.append(values[[place[key] for key in keys]])
    return Iterate(trajectory.durations, *rows)
