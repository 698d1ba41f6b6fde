"""Mesh refinement: which mesh comes next, coarser where nothing happens and finer where a limit is missed.

A first mesh is adapted until the Hamiltonian keeps near to -1 all along it; then all of its intervals are halved at
least. What the finer optimum gains in race time is what a mesh still does to the result. If that is too much, the
intervals that gained go back into the first mesh as fine as they are now.

Rates of commands enter the equations linearly, so the objective is curved in them by the regularisation alone: holding
a control that would vary by d about its mean costs about the integral of weight d^2 (the error of the zero-order hold).
Summed over a race that is a third to two thirds of what halving all intervals gains.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.certificate import RefinementReason
from airrace.optimal_control.evidence import Evidence
from airrace.optimal_control.mesh_refinement import Marks, Mesh, divide, inherited_nodes, restrict, widen
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.replay import Replay, estimate_error, interval_durations
from airrace.optimal_control.trajectory import Array, Indices

SAFETY = 0.5
"""Share that a mesh is made to keep. With 0.25 Rovinj takes 964 intervals in three solves; with 1 Air Race X takes
eleven solves."""
SAFETY_OF_DEFECT = 0.2
"""Share of the replay's limit that a mesh is made to keep. It is smaller than `safety` because on a coarse mesh the
integrator does not yet converge with its order. With 0.1 and 0.5 the meshes of Rovinj and of the half Cuban eight
differ by four intervals at most."""
NEIGHBOUR_SHARE = 0.1
"""Share of a neighbour's integration error expected in an interval once all are halved. The meshes of Rovinj and of the
half Cuban eight are the same with 0.03 and with 0.3."""
HAMILTONIAN_REJECT = 2.0
"""Multiple of the Hamiltonian's limit beyond which halving alone would change the race time. With 1 the half Cuban
eight takes 133 intervals in three solves; the other meshes are the same with 1 and with 4."""
HOLD_SAFETY = 3.0
"""Factor by which a coarse mesh underrates the cost of holding the controls. With 1 Rovinj takes 753 intervals and with
6 it takes 851, in as many solves."""
REFINE_AHEAD_DEFECT = 0.3
"""Share of the replay's limit from which on an interval is halved before it misses it. A fifth to a half of the
intervals of a stage's first mesh miss the limit on the shipped courses. When these were cut as well, all 24 stages
below the last met it on the next mesh, by a factor of four, on 19 % fewer intervals than with all halved."""
REFINE_AHEAD_HAMILTONIAN = 0.1
"""Share of the Hamiltonian's limit from which on an interval is halved before it misses it. With a half, 5 of those 24
stages missed it on the next mesh; with a tenth 3, as many as with all intervals halved."""
HAMILTONIAN_JUMP = 0.5
"""Share of the Hamiltonian's limit by which it changes from one interval to the next where a drift begins."""
COARSEN_BELOW = 1 / 40
"""Share of the Hamiltonian's limit below which half of the nodes are enough. With a quarter of it Rovinj and Air Race X
take 936 and 690 intervals; with four times as much 631 and 512, and race times that differ by 1e-4 and 3e-4 s."""
COARSEN_EXCESS = 1 / 32
"""Share of its limit below which an excess between nodes allows a node to be dropped, which makes it four times as
large. With a quarter of it Air Race X takes 586 intervals; the other meshes are the same, and with four times as much
all of them are."""
COARSEN_WORTHWHILE = 0.85
"""Share of the nodes that a coarser mesh may keep to be solved on. Meshes are the same with 0.7 and 0.95."""
LONGEST_JOINED = 0.6
"""Longest interval that comes of joining two, s. With 0.3 s Rovinj and Air Race X take 878 and 640 intervals, with 1.2
s 806 and 567."""
PHASE_INTERVALS_MIN = 4
"""Smallest number of intervals to which joining reduces a phase."""
PARTS_MAX = 6
"""Largest number of parts into which an interval is cut at once."""
ERROR_UNTRUSTED = 1e-2
"""Scaled deviation of a replayed interval beyond which an optimum has exploited the integrator's error. The meshes of
Rovinj and of the half Cuban eight are the same with 1e-3 and with 0.1."""
ADAPTATIONS_MAX = 2
"""Number of adaptations of a first mesh that is not wrong, before its intervals are halved."""
GROWTH_MAX = 6.0
"""Multiple of a first mesh beyond which no finer one is tried. Meshes on the shipped courses become 2.4 times as fine
at most. Where a limit is missed on every mesh, ever more intervals would be cut into four."""
GROWTH_FROM = 300
"""Number of intervals that a first mesh is taken to have at least for that: small ones have time to spare. A U-turn
within an airspace begins with 76 intervals and takes 1,562."""


class MeshLimits(Protocol):
    """What a mesh is made to keep: the limits of a race's certificate, or of that of any other problem.

    `replay` is of each interval's deviation, scaled; `hamiltonian` of the drift, in the unit that this is measured in.
    """

    @property
    def replay(self) -> float: ...

    @property
    def hamiltonian(self) -> float: ...

    def change_of(self, value: float, /) -> float:
        """Return by how much an optimum of this value may change when all intervals are halved, in its unit."""
        ...


@dataclass(frozen=True, eq=False)
class MeshProposal:
    """A mesh to be solved on, with a guess.

    Attributes:
        mesh: fractions of every phase.
        guess: on it.
        why: a `RefinementReason` per interval, shape (N,).
        coarser: which nodes belong to the mesh that this one was divided from, shape (N + 1,).
    """

    mesh: Mesh
    guess: Iterate
    why: NDArray[np.int8]
    coarser: Marks

    @property
    def intervals(self) -> int:
        """The number of intervals."""
        return len(self.why)

    @classmethod
    def first(cls, problem: Problem, guess: Iterate) -> Self:
        """Return the mesh that a stage begins with."""
        why = np.full(problem.intervals, RefinementReason.FIRST, dtype=np.int8)
        return cls(problem.mesh, guess, why, np.ones(problem.intervals + 1, dtype=np.bool_))


@dataclass(frozen=True)
class MeshSolution:
    """An optimum on a mesh; `measure` makes its `evidence` when that is first asked for.

    `value` is what a finer mesh changes, and two meshes are compared by: a race time, or the objective.
    """

    problem: Problem
    iterate: Iterate
    proposal: MeshProposal
    value: float
    measure: Callable[[], Evidence]

    @cached_property
    def evidence(self) -> Evidence:
        """The measurements of the optimum."""
        return self.measure()


def adapt(optimum: MeshSolution, limits: MeshLimits, *, early: bool, joining: bool) -> MeshProposal | None:
    """Return a better first mesh; None if the present one will do.

    Args:
        early: whether a mesh that is merely not good yet gets another solve.
        joining: whether nodes may be dropped.
    """
    drift, integration = optimum.evidence.drift, optimum.evidence.integration
    held = HOLD_SAFETY * predict_hold_cost(optimum.problem, optimum.iterate)
    change = limits.change_of(optimum.value)
    untrusted = ~(optimum.evidence.check.defect <= ERROR_UNTRUSTED)
    contributors = _largest_contributors(held + np.abs(integration), SAFETY * change)
    wanted = [
        (RefinementReason.INTEGRATION, np.where(widen(untrusted), 4.0, 1.0)),
        (RefinementReason.HAMILTONIAN, _parts_by_excess(_worst_nearby(drift), SAFETY * limits.hamiltonian)),
        (RefinementReason.RACE_TIME, np.where(contributors, 2.0, 1.0)),
    ]
    parts, why = _most(optimum, wanted)
    joined = _calm_pairs(optimum, parts, limits) if joining else np.zeros(len(parts), dtype=np.bool_)
    rejected = (
        bool((drift > HAMILTONIAN_REJECT * limits.hamiltonian).any()) or held.sum() + abs(integration.sum()) > change
    )
    worthwhile = parts.sum() - joined.sum() < COARSEN_WORTHWHILE * len(parts)
    if not untrusted.any() and not (early and rejected) and not worthwhile:
        return None
    nodes = np.ones(int(parts.sum()) + 1, dtype=np.bool_)
    nodes[_places(parts)[np.flatnonzero(joined) + 1]] = False
    return _restrict(_divide(optimum, parts, why, None), nodes, RefinementReason.CALM)


def bisect_all(optimum: MeshSolution, limits: MeshLimits) -> MeshProposal:
    """Return a mesh with all intervals halved at least, and cut into as many parts as they are expected to need."""
    parts, why = _required_parts(optimum, limits, nearby=NEIGHBOUR_SHARE)
    parts = np.maximum(parts, 2)
    return _divide(optimum, parts, why, inherited_nodes(parts))


def bisect_coarse(proposal: MeshProposal, replay: Replay | None = None) -> MeshProposal:
    """Return a mesh everywhere finer by half, at least, than the coarser mesh behind a proposal.

    Args:
        replay: of its controls, for states at the new nodes; None for states straight between the old ones.
    """
    sizes = np.diff(np.flatnonzero(proposal.coarser))
    parts = np.where(sizes == 1, 2, 1).astype(np.int64)[np.cumsum(proposal.coarser[:-1]) - 1]
    mesh, guess = divide(proposal.mesh, proposal.guess, replay, parts)
    return MeshProposal(mesh, guess, np.repeat(proposal.why, parts), _still_coarser(proposal, parts))


def refine_flagged(optimum: MeshSolution, limits: MeshLimits) -> MeshProposal | None:
    """Return a mesh that is finer where something is wrong between nodes; None if nothing is.

    Where a leg was cut before for the same reason, a control has moved to where it was not: a roll that is indifferent
    to its place on the leg. Then the whole leg becomes as fine.
    """
    parts, why = _required_parts(optimum, limits, nearby=1.0)
    for reason in (RefinementReason.INTEGRATION, RefinementReason.LIMITS):
        again = _as_long_as(optimum, (parts > 1) & (why == reason), reason) & (parts == 1)
        parts[again], why[again] = 2, reason
    return None if (parts == 1).all() else _divide(optimum, parts, why, _still_coarser(optimum.proposal, parts))


def refine_predicted(optimum: MeshSolution, limits: MeshLimits) -> MeshProposal | None:
    """Return a mesh that is finer where something is wrong between nodes or nearly so; None if nothing is wrong.

    The optimum on it is expected to keep all limits, where one on the mesh of `refine_flagged` often misses another.
    """
    parts, why = _required_parts(optimum, limits, nearby=1.0)
    if (parts == 1).all():
        return None
    defect, drift = optimum.evidence.check.defect, optimum.evidence.drift
    ahead = [
        (RefinementReason.INTEGRATION, _bisected_above(defect, REFINE_AHEAD_DEFECT * limits.replay)),
        (RefinementReason.HAMILTONIAN, _bisected_above(drift, REFINE_AHEAD_HAMILTONIAN * limits.hamiltonian)),
    ]
    more, reasons = _most(optimum, ahead)
    parts, why = np.maximum(parts, more), np.where(more > parts, reasons, why).astype(np.int8)
    return _divide(optimum, parts, why, _still_coarser(optimum.proposal, parts))


def refine_guess(proposal: MeshProposal, problem: Problem, limits: MeshLimits) -> MeshProposal:
    """Return a mesh that is finer where a guess lets expect that the integrator's error breaks its limit.

    Args:
        problem: on the mesh of the proposal.
    """
    error = np.abs(estimate_error(problem, proposal.guess)).max(axis=0)
    parts = np.where(error > SAFETY * limits.replay, 2, 1).astype(np.int64)
    mesh, guess = divide(proposal.mesh, proposal.guess, None, parts)
    why = np.where(parts > 1, RefinementReason.INTEGRATION, proposal.why).astype(np.int8)
    return MeshProposal(mesh, guess, np.repeat(why, parts), _still_coarser(proposal, parts))


def refine_changed(optimum: MeshSolution, before: MeshSolution, limits: MeshLimits) -> MeshProposal:
    """Return a better first mesh from an optimum whose race time differs too much from that on the mesh before.

    The intervals that are taken to have changed it most stay as fine as they are, all others become what they were.
    """
    limit = SAFETY * limits.change_of(optimum.value)
    contributors = widen(_largest_contributors(_changed_by(optimum, before), limit))
    fine = contributors[np.cumsum(optimum.proposal.coarser[:-1]) - 1]
    nodes = optimum.proposal.coarser.copy()
    nodes[:-1] |= fine
    why = np.where(fine, RefinementReason.RACE_TIME, optimum.proposal.why).astype(np.int8)
    return _restrict(MeshProposal(optimum.proposal.mesh, optimum.iterate, why, optimum.proposal.coarser), nodes)


def predict_hold_cost(problem: Problem, iterate: Iterate) -> Array:
    """Estimate what holding the controls over every interval costs, s; shape (N,).

    A control is taken to change by half of the larger jump at the ends of its interval.
    """
    weights, controls, steps = _scaled_controls(problem, iterate)
    jumps = np.abs(np.diff(controls, axis=1))
    largest = np.zeros_like(controls)
    largest[:, 1:] = jumps
    largest[:, :-1] = np.maximum(largest[:, :-1], jumps)
    return steps * (weights @ (0.25 * largest) ** 2)


def measure_hold_cost(problem: Problem, iterate: Iterate, coarser: Marks) -> Array:
    """Measure what holding the controls over every interval of a coarser mesh costs, s; shape (coarser.sum() - 1,).

    Args:
        iterate: on the finer mesh.
        coarser: which nodes belong to the coarser mesh, shape (N + 1,).
    """
    weights, controls, steps = _scaled_controls(problem, iterate)
    group = np.cumsum(coarser[:-1]) - 1
    lengths = np.bincount(group, weights=steps)
    means = np.stack([np.bincount(group, weights=steps * row) for row in controls]) / lengths
    cost: Array = steps * (weights @ (controls - means[:, group]) ** 2)
    return np.bincount(group, weights=cost).astype(np.float64)


def _scaled_controls(problem: Problem, iterate: Iterate) -> tuple[Array, Array, Array]:
    """Return the weights of the regularisation (n_u,), scaled controls (n_u, N), lengths of the intervals (N,)."""
    weights = [problem.objective.regularisation.get(quantity.name, 0.0) for quantity in problem.system.controls]
    scale = np.array([quantity.scale for quantity in problem.system.controls])[:, None]
    return np.array(weights), iterate.control / scale, interval_durations(problem, iterate.durations)


def _changed_by(optimum: MeshSolution, before: MeshSolution) -> Array:
    """Estimate what the intervals of the mesh before have changed of the race time, s; shape (N before,).

    What is not the integrator's error is due to controls that are held less long, if the finer mesh is faster; if it is
    slower, to limits that hold at more nodes.
    """
    integration = before.evidence.integration
    changed = optimum.value - before.value
    if changed < 0.0:
        cost = measure_hold_cost(optimum.problem, optimum.iterate, optimum.proposal.coarser)
    else:
        cost = before.evidence.check.excess * interval_durations(before.problem, before.iterate.durations)
    share = cost / cost.sum() if cost.any() else np.full(len(cost), 1.0 / len(cost))
    return np.abs(integration) + abs(changed - integration.sum()) * share


def _largest_contributors(cost: Array, limit: float) -> Marks:
    """Return the intervals that cost most, so many that the others together keep within a limit; shape (N,)."""
    order = np.argsort(-cost)
    left = cost.sum() - np.cumsum(cost[order])
    largest = np.zeros(len(cost), dtype=np.bool_)
    if cost.sum() > limit:
        largest[order[: int(np.argmax(left <= limit)) + 1]] = True
    return largest


def _required_parts(optimum: MeshSolution, limits: MeshLimits, *, nearby: float) -> tuple[Indices, NDArray[np.int8]]:
    """Return the number of parts that each interval needs for every indicator to keep its limit, and the reason.

    Args:
        nearby: how much of the integration error beside an interval is expected in it.
    """
    check, drift = optimum.evidence.check, optimum.evidence.drift
    order = optimum.problem.scheme.order + 1  # of what is left in one interval
    defect = np.maximum(check.defect, nearby * _worst_nearby(check.defect))
    integration = np.ceil((defect / (SAFETY_OF_DEFECT * limits.replay)) ** (1 / order))
    wanted = [
        (RefinementReason.INTEGRATION, np.where(defect <= limits.replay, 1, np.maximum(integration, 2))),
        (RefinementReason.LIMITS, _parts_by_excess(_worst_nearby(check.excess), 1.0)),
        # It falls slowly with the length of the interval.
        (RefinementReason.HAMILTONIAN, np.where(_off_hamiltonian(drift, limits.hamiltonian), 4.0, 1.0)),
    ]
    return _most(optimum, wanted)


def _most(optimum: MeshSolution, wanted: list[tuple[RefinementReason, Array]]) -> tuple[Indices, NDArray[np.int8]]:
    """Return the largest number of parts that any indicator asks for in each interval, and which indicator it is."""
    most = PARTS_MAX
    counts = np.nan_to_num(np.stack([count for _, count in wanted]), nan=most, posinf=most)
    parts = np.clip(counts.max(axis=0), 1, most).astype(np.int64)
    reasons = np.array([why for why, _ in wanted], dtype=np.int8)[counts.argmax(axis=0)]
    return parts, np.where(parts > 1, reasons, optimum.proposal.why).astype(np.int8)


def _bisected_above(values: Array, limit: float) -> Array:
    """Return two parts where a limit is exceeded in an interval or beside it."""
    return np.where(_worst_nearby(values) <= limit, 1.0, 2.0)


def _as_long_as(optimum: MeshSolution, some: Marks, reason: RefinementReason) -> Marks:
    """Return the intervals as long as the shortest one of some on the same leg, within a tenth; shape (N,).

    Of legs alone that have intervals which were cut before for a reason.
    """
    steps = interval_durations(optimum.problem, optimum.iterate.durations)
    counts = [len(phase.fractions) for phase in optimum.problem.phases]
    leg, shortest = np.repeat(np.arange(len(counts)), counts), np.full(len(counts), np.inf)
    np.minimum.at(shortest, leg[some], steps[some])
    cut = np.bincount(leg[optimum.proposal.why == reason], minlength=len(counts)) > 0
    return (steps > 0.9 * shortest[leg]) & cut[leg]


def _parts_by_excess(values: Array, limit: float) -> Array:
    """Return two parts where a limit is exceeded, four where it is exceeded by far."""
    return np.where(values <= limit, 1.0, np.where(values <= 4.0 * limit, 2.0, 4.0))


def _off_hamiltonian(drift: Array, limit: float) -> Marks:
    """Return the intervals at or beside which the Hamiltonian drifts too far, and those where such a drift begins.

    It is constant but for errors. Where a limit is touched between two nodes it jumps at one of them, and stays there
    for all that follows, however finely that is cut.
    """
    off = ~(_worst_nearby(drift) <= limit)
    if off.any():
        jumps = np.abs(np.diff(drift)) > HAMILTONIAN_JUMP * limit
        off[:-1] |= jumps
        off[1:] |= jumps
    return off


def _worst_nearby(values: Array) -> Array:
    """Return the largest value of each interval and its neighbours, to which an error moves when one is refined."""
    worst = values.copy()
    worst[1:] = np.maximum(worst[1:], values[:-1])
    worst[:-1] = np.maximum(worst[:-1], values[1:])
    return worst


def _calm_pairs(optimum: MeshSolution, parts: Indices, limits: MeshLimits) -> Marks:
    """Return the intervals that may be joined with the next one, which is not joined with another; shape (N,)."""
    problem, evidence = optimum.problem, optimum.evidence
    busy = (
        widen(parts > 1)
        | (interval_durations(problem, optimum.iterate.durations) > 0.5 * LONGEST_JOINED)
        | (_worst_nearby(evidence.drift) >= COARSEN_BELOW * limits.hamiltonian)
        | (evidence.check.defect >= 0.5 * SAFETY * limits.replay)
        | (evidence.check.excess >= COARSEN_EXCESS)
    )
    joined = np.zeros(problem.intervals, dtype=np.bool_)
    for first, last in zip(problem.first_node, problem.first_node[1:], strict=False):
        left, interval = last - first, first
        while interval + 1 < last and left > PHASE_INTERVALS_MIN:
            if busy[interval] or busy[interval + 1]:
                interval += 1
            else:
                joined[interval] = True
                left, interval = left - 1, interval + 2
    return joined


def _divide(optimum: MeshSolution, parts: Indices, why: NDArray[np.int8], coarser: Marks | None) -> MeshProposal:
    """Return the mesh with intervals cut into parts; all nodes are its own first ones without a coarser mesh."""
    mesh, guess = divide(optimum.problem.mesh, optimum.iterate, optimum.evidence.replay, parts)
    nodes = np.ones(int(parts.sum()) + 1, dtype=np.bool_) if coarser is None else coarser
    return MeshProposal(mesh, guess, np.repeat(why, parts), nodes)


def _restrict(proposal: MeshProposal, nodes: Marks, why_joined: RefinementReason | None = None) -> MeshProposal:
    """Return a first mesh of these nodes alone; without another reason, joined intervals keep their own."""
    mesh, guess = restrict(proposal.mesh, proposal.guess, nodes)
    why = proposal.why[nodes[:-1]]
    if why_joined is not None:
        alone = np.bincount(np.cumsum(nodes[:-1]) - 1) == 1
        why = np.where(alone, why, why_joined).astype(np.int8)
    return MeshProposal(mesh, guess, why, np.ones(int(nodes.sum()), dtype=np.bool_))


def _still_coarser(proposal: MeshProposal, parts: Indices) -> Marks:
    """Return the nodes of the coarser mesh behind a proposal, when its intervals are cut into so many parts."""
    coarser = np.zeros(int(parts.sum()) + 1, dtype=np.bool_)
    coarser[_places(parts)] = proposal.coarser
    return coarser


def _places(parts: Indices) -> Indices:
    """Return the places of the old nodes in a divided mesh, shape (N + 1,)."""
    return np.concatenate([[0], np.cumsum(parts)])
