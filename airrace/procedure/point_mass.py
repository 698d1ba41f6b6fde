"""The point-mass stage: the joint optimum over all phases, certified, on a mesh refined where it must be."""

from airrace.optimal_control.audit import Audit, Tolerance, audit
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import bisect
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers import Solution
from airrace.procedure.conclusion import conclude
from airrace.procedure.diagnosis import diagnose
from airrace.procedure.flight import PointMassFlight
from airrace.procedure.result import Outcome, Stage, StageResult
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.solving import Workbench

COLD_BARRIER = 0.1
WARM_BARRIER = 1e-2  # of a solve that starts from an optimum on a coarser mesh, or from assembled pieces


def optimise_point_mass(
    flight: PointMassFlight, bench: Workbench, problem: Problem, guess: Iterate, *, barrier: float, explain: bool = True
) -> StageResult:
    """Solve jointly, measure, refine and solve again until the certificate holds or the refinements are used up.

    Where there is no solution, find out why if `explain`; that takes further solves.
    """
    limits = bench.settings.certificate
    total = bench.settings.mesh.refinements_max
    for refinement in range(total + 1):
        purpose = f"all {len(problem.phases)} phases" + (f", refinement {refinement}" if refinement else "")
        bench.progress.activity(f"{purpose}, {problem.intervals} intervals", refinement, 0)
        solution = bench.solve(problem, guess, purpose, barrier=barrier)
        if solution is None or not solution.success:
            return _unsolved(flight, bench, problem, solution, guess, explain=explain)
        flown = replay(problem, solution.iterate)
        measured = audit(problem, solution.iterate, flown, tolerances=tolerances(limits), defect_limit=limits.replay)
        certificate = certified(solution, measured, limits)
        if certificate.certified or not measured.coarse.any() or refinement == total:
            return _finished(flight, bench, problem, solution, certificate)
        mesh, guess = bisect(problem, solution.iterate, flown, measured.coarse)
        problem, barrier = flight.problem(mesh), WARM_BARRIER
    raise AssertionError("the last refinement returns")


def tolerances(limits: CertificateLimits) -> tuple[Tolerance, ...]:
    """What may be violated between nodes and at gates, by unit. Coefficients count as load factors.

    The rows of a gate in unit "1" are sines and excesses of small angles, so their limit is that of gate angles.
    """
    return (
        Tolerance("load_factor", ("1",), limits.load_factor, limits.gate_angle, "attitude"),
        Tolerance("length", ("m",), limits.length, limits.gate_length),
        Tolerance("angle", ("rad",), limits.angle, limits.gate_angle),
        Tolerance("angular_rate", ("rad/s",), limits.angle, limits.gate_angle),
        Tolerance("speed", ("m/s",), limits.speed, limits.speed),
    )


def certified(solution: Solution, measured: Audit, limits: CertificateLimits) -> Certificate:
    """The certificate of a solution."""
    solved = Item("solver", 0.0 if solution.success else 1.0, 0.0, "", solution.status)
    kkt = Item("kkt_error", solution.kkt.largest, limits.kkt_error, "scaled", "")
    return Certificate(f"{solution.solver}: {solution.status}", (solved, kkt, *measured.items))


def _finished(
    flight: PointMassFlight, bench: Workbench, problem: Problem, solution: Solution, certificate: Certificate
) -> StageResult:
    failed = ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} ({item.where})" for item in certificate.failed)
    return conclude(
        flight,
        bench,
        problem,
        solution.iterate,
        stage=Stage.POINT_MASS,
        outcome=Outcome.SOLVED if certificate.certified else Outcome.NOT_CERTIFIED,
        message=f"solved but not certified: {failed}" if failed else "",
        multipliers=solution.multipliers,
        certificate=certificate,
    )


def _unsolved(
    flight: PointMassFlight,
    bench: Workbench,
    problem: Problem,
    solution: Solution | None,
    guess: Iterate,
    *,
    explain: bool,
) -> StageResult:
    """No optimum: say what stands in the way."""
    if solution is None:
        outcome, message = Outcome.TIMEOUT, "the solver finished no iteration for too long and was stopped"
    elif solution.infeasible:
        outcome, message = Outcome.INFEASIBLE, f"no flight satisfies all limits, most violated: {solution.worst}"
        if explain:
            message = diagnose(bench, problem, solution, guess)
    else:
        outcome = Outcome.NOT_CONVERGED
        message = (
            f"{solution.solver} gave up ({solution.status}), most violated: {solution.worst}; "
            "try the other --guess, a finer settings.mesh.interval_s, or milder rules"
        )
    return conclude(
        flight,
        bench,
        problem,
        guess if solution is None else solution.iterate,
        stage=Stage.POINT_MASS,
        outcome=outcome,
        message=message,
    )
