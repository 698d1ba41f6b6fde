"""The measurements of an optimum, the certificate that they make, and the result of a stage.

Among them is the wing's distance from all pylons of a course on the replay of an optimum.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from airrace.model.track.course import ClearanceRule
from airrace.optimal_control.certificate import (
    HAMILTONIAN_DRIFT,
    RACE_TIME_CHANGE,
    Certificate,
    Item,
    SecondOrder,
)
from airrace.optimal_control.constraint_check import Tolerance, check_constraints
from airrace.optimal_control.evidence import Evidence, negative_curvature
from airrace.optimal_control.mesh_proposals import ERROR_UNTRUSTED
from airrace.optimal_control.optimality import errors_in_objective, hamiltonian
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import Replay, interval_durations, replay, replay_phases
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.trajectory import Array
from airrace.procedure.planning.clearance import ClosestApproach, Wing, closest_approaches, pylons_of, wing_position
from airrace.procedure.result import (
    CLEARANCE,
    NO_PROVENANCE,
    NO_RECORD,
    MeshRecord,
    Note,
    StageProvenance,
    StageResult,
    Status,
)
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.solver_session import SolverSession
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import StageProblem, gate_splits, trajectory_of

ACCELERATIONS = (
    ("acceleration", "m/s2"),
    ("angular_acceleration", "rad/s2"),
    ("load_factor_acceleration", "1/s2"),
)
"""The names and units of the accelerations that are zero at a settled start or finish."""
ROUGH_TOLERANCE = 1e-4
"""The solver's tolerance on a mesh that only leads to the single good one, and of a stage that only leads to the next
one. On Rovinj such a solve takes 23 to 31 iterations instead of 29 to 38. Race times of such stages are up to 29 ms too
long on 13 courses; those of two routes by the same amount within 2 ms, on two. With 1e-3 they are up to 170 ms too
long, and all stages above the point mass take a tenth fewer iterations and end in the same optimum."""
ROUGH_KKT_ERROR = 1e-3
"""The largest error of the conditions of optimality after such a solve, scaled: ten times its tolerance, as the
certificate allows of the settings' tolerance, for both measure on scales of their own."""
SETTLED = 1e-6
"""The largest value of a quantity that is at rest at a settled start or finish, in its SI unit."""


def rough_limits(limits: CertificateLimits) -> CertificateLimits:
    """Return the limits of an optimum that the next stage starts from: solved roughly, and not made of errors."""
    kkt_error = max(ROUGH_KKT_ERROR, limits.kkt_error)
    return replace(limits, kkt_error=kkt_error, replay=ERROR_UNTRUSTED)


def examine(problem: Problem, iterate: Iterate, constraint_multipliers: Array, limits: CertificateLimits) -> Evidence:
    """Measure an optimum."""
    again = replay(problem, iterate)
    drift = np.abs(hamiltonian(problem, iterate, constraint_multipliers) + problem.objective.time)
    measured = check_constraints(problem, iterate, again, tolerances=tolerances(limits), defect_limit=limits.replay)
    integration = errors_in_objective(problem, again.defect, constraint_multipliers)
    return Evidence(again, measured, drift, integration)


def certify(
    problem: Problem,
    iterate: Iterate,
    evidence: Evidence,
    limits: CertificateLimits,
    *,
    claim: Item,
    status: str,
    kkt_error: float,
    second_order: SecondOrder | None,
    coarser_race_time: float | None,
    clearance: Item | None = None,
) -> Certificate:
    """Return the certificate of an optimum.

    Args:
        claim: what the solver says, as an item.
        status: its own words.
        kkt_error: of the conditions of optimality, scaled.
        second_order: what the curvature tells; None where it could not be measured, which never holds.
        coarser_race_time: of the optimum on a mesh of at most half the intervals everywhere, s; NaN if none was found,
            which never holds; None if none was looked for, which leaves the item out.
        clearance: the item on the wing's distance from pylons; None leaves it out.
    """
    kkt = Item("kkt_error", kkt_error, limits.kkt_error, "scaled", "")
    replayed, *between = evidence.check.items
    items = (
        *(claim, kkt, negative_curvature(second_order), replayed, _missed_gates(problem, iterate, limits), *between),
        *(() if clearance is None else (clearance,)),
        _hamiltonian(problem, iterate, evidence.drift, limits),
        *_race_time_change(iterate, coarser_race_time, limits),
        *variations(problem, iterate, limits),
    )
    return Certificate(status, items, second_order)


def certify_rough(
    problem: Problem,
    iterate: Iterate,
    defect: Item,
    limits: CertificateLimits,
    *,
    claim: Item,
    status: str,
    kkt_error: float,
) -> Certificate:
    """Return the certificate of an optimum that the next stage starts from.

    It has none of the items that only a good mesh keeps. The limits at nodes are part of the conditions of optimality.

    Args:
        defect: the item of the replay's largest deviation from the next node.
        limits: see `rough_limits`.
        claim, status, kkt_error: as of `certify`.
    """
    kkt = Item("kkt_error", kkt_error, limits.kkt_error, "scaled", "")
    return Certificate(
        status, (claim, kkt, replace(defect, limit=limits.replay), *variations(problem, iterate, limits))
    )


def tolerances(limits: CertificateLimits) -> tuple[Tolerance, ...]:
    """Return the excesses that are allowed between nodes and at gates, by unit; coefficients count as load factors.

    The rows of a gate in unit "1" are sines and excesses of small angles, so their limit is that of gate angles. Rates
    and accelerations are limited at a settled start or finish only.
    """
    return (
        Tolerance("load_factor", ("1",), limits.load_factor, limits.gate_angle, "attitude"),
        # In 0.05 s the excess of the rate may add up to that of the load factor.
        Tolerance("load_factor_rate", ("1/s",), limits.load_factor / 0.05, SETTLED),
        Tolerance("length", ("m",), limits.length, limits.gate_length),
        Tolerance("angle", ("rad",), limits.angle, limits.gate_angle),
        Tolerance("angular_rate", ("rad/s",), limits.angle, SETTLED),
        *(Tolerance(name, (unit,), SETTLED, SETTLED) for name, unit in ACCELERATIONS),
        Tolerance("speed", ("m/s",), limits.speed, limits.speed),
    )


def variations(problem: Problem, iterate: Iterate, limits: CertificateLimits) -> Iterator[Item]:
    """Yield an item for everything that a pilot moves: its total variation per second.

    That is the mean magnitude of its rate, in the rate's unit.
    """
    steps = interval_durations(problem, iterate.durations)
    for quantity, rates in zip(problem.system.controls, iterate.control, strict=True):
        fastest = max(-quantity.lower, quantity.upper)
        if quantity.rate_of and math.isfinite(fastest):
            mean = float(np.abs(rates) @ steps / steps.sum())
            yield Item(
                f"variation_{quantity.rate_of}", mean, limits.variation * fastest, quantity.unit, "mean over the race"
            )


def _race_time_change(iterate: Iterate, coarser: float | None, limits: CertificateLimits) -> Iterator[Item]:
    """Return what the mesh still does to the race time; nothing where that was not looked for."""
    if coarser is not None:
        race_time = float(iterate.durations.sum())
        limit = limits.change_of(race_time)
        yield Item(RACE_TIME_CHANGE, abs(race_time - coarser), limit, "s", "against a mesh of half the intervals")


def _missed_gates(problem: Problem, iterate: Iterate, limits: CertificateLimits) -> Item:
    """Return the item of the farthest miss of a gate by a leg that is integrated in one go: the largest length, m."""
    lengths = [row for row, state in enumerate(problem.system.states) if state.unit == "m"]
    missed = np.abs(replay_phases(problem, iterate)[lengths])
    row, phase = np.unravel_index(int(missed.argmax()), missed.shape)
    where = f"{problem.phases[int(phase)].name}, {problem.system.states[lengths[int(row)]].name}"
    return Item("replay_gate", float(missed.max()), limits.replay_gate, "m", where)


def _hamiltonian(problem: Problem, iterate: Iterate, drift: Array, limits: CertificateLimits) -> Item:
    """Return the item of the Hamiltonian's largest distance from -1."""
    worst = int(drift.argmax())
    time = float(interval_durations(problem, iterate.durations)[:worst].sum())
    where = f"{problem.phase_of(worst).name}, {time:.2f} s"
    return Item(HAMILTONIAN_DRIFT, float(drift.max()), limits.hamiltonian, "1", where)


def failures(items: Sequence[Item]) -> str:
    """Return the items that do not hold, as part of a sentence."""
    return ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} ({item.where})" for item in items)


def conclude(
    stage_problem: StageProblem,
    session: SolverSession,
    problem: Problem,
    iterate: Iterate,
    *,
    outcome: Status,
    stage: Stage | None = None,
    message: str = "",
    multipliers: Multipliers | None = None,
    certificate: Certificate | None = None,
    provenance: StageProvenance = NO_PROVENANCE,
    mesh: MeshRecord = NO_RECORD,
    notes: tuple[Note, ...] = (),
) -> StageResult:
    """Return the result of a stage, by default the flight's own; without multipliers theirs are empty."""
    trajectory = trajectory_of(problem, iterate)
    return StageResult(
        stage=stage or stage_problem.stage,
        outcome=outcome,
        message=message,
        trajectory=trajectory,
        constraint_multipliers=np.zeros(0) if multipliers is None else multipliers.constraints,
        bound_multipliers=np.zeros(0) if multipliers is None else multipliers.bounds,
        certificate=certificate,
        splits=gate_splits(stage_problem, trajectory),
        attempts=tuple(session.attempts),
        timings=session.timings(),
        provenance=provenance,
        mesh=mesh,
        notes=notes,
        pylon_conditions=stage_problem.pylon_conditions,
    )


def replayed_wing(
    stage_problem: StageProblem, problem: Problem, iterate: Iterate, replay: Replay
) -> tuple[Wing, list[int]]:
    """Return the way of the wing on a replay, and the numbers of its times at which legs begin and, last, it ends."""
    parts = replay.state.shape[2] - 1
    steps = interval_durations(problem, iterate.durations)
    ends = np.cumsum(steps)
    inside: Array = (ends - steps)[:, None] + steps[:, None] * np.linspace(0.0, 1.0, parts, endpoint=False)
    time: Array = np.append(inside.ravel(), ends[-1])
    rows = np.concatenate([replay.state[:, :, :-1].reshape(len(replay.state), -1), replay.state[:, -1:, -1]], axis=1)
    x = dict(zip((state.name for state in problem.system.states), rows, strict=True))
    wing = Wing(time, *wing_position(x, 0.5 * stage_problem.aircraft.airframe.b))
    return wing, [parts * node for node in problem.first_node]


def approaches(
    stage_problem: StageProblem, problem: Problem, iterate: Iterate, replay: Replay
) -> list[ClosestApproach]:
    """Return the least distances of the wing from every pylon of the course, see `closest_approaches`."""
    wing, legs = replayed_wing(stage_problem, problem, iterate, replay)
    return list(closest_approaches(wing, pylons_of(stage_problem.course), legs))


def clearance_item(
    stage_problem: StageProblem, problem: Problem, wing_approaches: Sequence[ClosestApproach], limits: CertificateLimits
) -> Item:
    """Return the item on the length by which the wing misses its clearance from a pylon at any time, at worst.

    By the rule `crossing` it is only measured where no obstacle is too near: then nothing is too much.

    Args:
        wing_approaches: see `approaches`.
    """
    always = stage_problem.course.rules.clearance is ClearanceRule.FLIGHT
    violated = [approach for approach in wing_approaches if approach.shortfall > 0.0]
    binding = [
        approach
        for approach in violated
        if always or (approach.pylon.is_obstacle and approach.shortfall > limits.gate_length)
    ]
    limit = limits.gate_length if always or binding else math.inf
    if not violated:
        return Item(CLEARANCE, 0.0, limit, "m", "")
    worst = max(binding or violated, key=lambda approach: approach.shortfall)
    where = f"{problem.phases[worst.leg].name}, {worst.pylon.text}, {worst.time:.2f} s"
    return Item(CLEARANCE, worst.shortfall, limit, "m", where)
