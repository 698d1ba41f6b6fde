"""The joint optimum of a stage over all phases, certified, on a mesh refined where it must be.

It can be started from several flights, and solved with several solvers. The first that leads to a certified optimum
counts: the primary solver from all starts, then the fallback from those from which it found none.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airrace.optimal_control.audit import Audit, Tolerance, audit
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import bisect
from airrace.optimal_control.replay import interval_durations, replay
from airrace.optimal_control.solvers import Solution
from airrace.procedure.conclusion import conclude
from airrace.procedure.diagnosis import diagnose
from airrace.procedure.flight import Flight
from airrace.procedure.result import NO_FACTS, Facts, Outcome, StageResult
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.solving import Workbench

RATE = "_dot"  # what the names of controls that move something end with
MOMENT = 0.05  # s, within which an excess of a load factor's rate may not add up to one of the load factor
COLD_BARRIER = 0.1
PIECED_BARRIER = 1e-2  # of a solve that starts from assembled pieces
HANDOVER_BARRIER = 1e-4  # of one that starts from another stage: more leads astray and back, in twice the iterations
REFINED_BARRIER = 1e-6  # of one that starts from an optimum on a coarser mesh


@dataclass(frozen=True)
class Start:
    """A flight to start from: on the mesh of its problem, with the first value of the barrier parameter.

    `facts` say where it comes from.
    """

    problem: Problem
    guess: Iterate
    barrier: float
    facts: Facts = NO_FACTS


@dataclass(frozen=True)
class Failure:
    """No optimum from a start; `solution` is where the solver gave up, None if it never came back."""

    start: Start
    solution: Solution | None


def optimise_jointly(flight: Flight, bench: Workbench, starts: Sequence[Callable[[], Start]]) -> StageResult:
    """The certified optimum; if none is found, the optimum that is not certified, or why there is none.

    Args:
        starts: in the order in which they are tried; each is made when its turn comes.
    """
    made: list[Start] = []
    uncertified: dict[int, StageResult] = {}
    failures: list[Failure] = []
    for solver in bench.solvers:
        for number, make in enumerate(starts):
            if number in uncertified:
                continue  # another solver would find the same optimum
            if number == len(made):
                if any(failure.solution is None for failure in failures):
                    break  # making a start takes solves, too: they would hang like the ones before
                made.append(make())
            found = _refined(flight, bench, made[number], solver)
            if isinstance(found, Failure):
                failures.append(found)
            elif found.certified:
                return found
            else:
                uncertified[number] = found
    return next(iter(uncertified.values())) if uncertified else _unsolved(flight, bench, failures)


def _refined(flight: Flight, bench: Workbench, start: Start, solver: str) -> StageResult | Failure:
    """Solve jointly, measure, refine and solve again until the certificate holds or the refinements are used up."""
    limits = bench.settings.certificate
    total = bench.settings.mesh.refinements_max
    problem, guess, barrier = start.problem, start.guess, start.barrier
    solvers = (solver,)
    for refinement in range(total + 1):
        purpose = f"all {len(problem.phases)} phases" + (f", refinement {refinement}" if refinement else "")
        bench.progress.activity(f"{purpose}, {problem.intervals} intervals", refinement, 0)
        solution = bench.solve(problem, guess, purpose, barrier=barrier, solvers=solvers)
        if solution is None or not solution.success:
            return Failure(start, solution)
        flown = replay(problem, solution.iterate)
        measured = audit(problem, solution.iterate, flown, tolerances=tolerances(limits), defect_limit=limits.replay)
        certificate = certified(problem, solution, measured, limits)
        if certificate.certified or not measured.coarse.any() or refinement == total:
            return _finished(flight, bench, problem, solution, certificate, start.facts)
        mesh, guess = bisect(problem, solution.iterate, flown, measured.coarse)
        problem, barrier, solvers = flight.problem(mesh), REFINED_BARRIER, bench.solvers
    raise AssertionError("the last refinement returns")


def tolerances(limits: CertificateLimits) -> tuple[Tolerance, ...]:
    """What may be violated between nodes and at gates, by unit. Coefficients count as load factors.

    The rows of a gate in unit "1" are sines and excesses of small angles, so their limit is that of gate angles.
    """
    return (
        Tolerance("load_factor", ("1",), limits.load_factor, limits.gate_angle, "attitude"),
        Tolerance("load_factor_rate", ("1/s",), limits.load_factor / MOMENT, limits.load_factor / MOMENT),
        Tolerance("length", ("m",), limits.length, limits.gate_length),
        Tolerance("angle", ("rad",), limits.angle, limits.gate_angle),
        Tolerance("angular_rate", ("rad/s",), limits.angle, limits.gate_angle),
        Tolerance("speed", ("m/s",), limits.speed, limits.speed),
    )


def certified(problem: Problem, solution: Solution, measured: Audit, limits: CertificateLimits) -> Certificate:
    """The certificate of a solution."""
    solved = Item("solver", 0.0 if solution.success else 1.0, 0.0, "", solution.status)
    kkt = Item("kkt_error", solution.kkt.largest, limits.kkt_error, "scaled", "")
    items = (solved, kkt, *measured.items, *variations(problem, solution.iterate, limits))
    return Certificate(f"{solution.solver}: {solution.status}", items)


def variations(problem: Problem, iterate: Iterate, limits: CertificateLimits) -> Iterator[Item]:
    """Total variation per second of everything a pilot moves: what its bounded rate adds up to, whichever way."""
    steps = interval_durations(problem, iterate.durations)
    for quantity, rates in zip(problem.system.controls, iterate.control, strict=True):
        fastest = max(-quantity.lower, quantity.upper)
        if quantity.name.endswith(RATE) and math.isfinite(fastest):
            name = quantity.name.removesuffix(RATE)
            mean = float(np.abs(rates) @ steps / steps.sum())
            yield Item(f"variation_{name}", mean, limits.variation * fastest, quantity.unit, "mean over the race")


def _finished(
    flight: Flight,
    bench: Workbench,
    problem: Problem,
    solution: Solution,
    certificate: Certificate,
    facts: Facts,
) -> StageResult:
    failed = ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} ({item.where})" for item in certificate.failed)
    return conclude(
        flight,
        bench,
        problem,
        solution.iterate,
        outcome=Outcome.SOLVED if certificate.certified else Outcome.NOT_CERTIFIED,
        message=f"solved but not certified: {failed}" if failed else "",
        multipliers=solution.multipliers,
        certificate=certificate,
        facts=replace(facts, regularisation=solution.objective - float(solution.iterate.durations.sum())),
    )


def _unsolved(flight: Flight, bench: Workbench, failures: Sequence[Failure]) -> StageResult:
    """No optimum: say what stands in the way."""
    returned = [failure for failure in failures if failure.solution is not None]
    claimed = [failure for failure in returned if failure.solution is not None and failure.solution.infeasible]
    failure = (claimed or returned or list(failures))[0]
    outcome, message = _explained(bench, failure)
    solution = failure.solution
    return conclude(
        flight,
        bench,
        failure.start.problem,
        failure.start.guess if solution is None else _last_flight(failure.start, solution),
        outcome=outcome,
        message=message,
    )


def _last_flight(start: Start, solution: Solution) -> Iterate:
    """Where the solver gave up; the start itself if that was on a finer mesh."""
    same_mesh = solution.iterate.state.shape == start.guess.state.shape
    return solution.iterate if same_mesh else start.guess


def _explained(bench: Workbench, failure: Failure) -> tuple[Outcome, str]:
    start, solution = failure.start, failure.solution
    if solution is None:
        return Outcome.TIMEOUT, "the solver finished no iteration for too long and was stopped"
    gave_up = f"{solution.solver} gave up ({solution.status}), most violated: {solution.worst}"
    advice = "try the other --guess, a finer settings.mesh.interval_s, or milder rules"
    if solution.infeasible:
        conflict = diagnose(bench, start.problem, _last_flight(start, solution), start.guess)
        if conflict is not None:
            return Outcome.INFEASIBLE, f"{conflict}; most violated: {solution.worst}"
        return Outcome.NOT_CONVERGED, f"{gave_up}; the legs around it can be flown by themselves; {advice}"
    return Outcome.NOT_CONVERGED, f"{gave_up}; {advice}"
