"""The choice of the next mesh: coarser where nothing happens, finer where something is wrong, until a proof.

A first mesh is adapted until the Hamiltonian keeps near to -1 all along it; then all of its intervals are halved at
least. What the finer optimum gains in race time is what a mesh still does to the result. If that is too much, the
intervals that gained go back into the first mesh as fine as they are now.

What is said here of other values of the constants was measured on the point mass of the half Cuban eight, Rovinj 2014
and Air Race X 2024, straight from the plan and proved. Of the three, the proved meshes have 153, 806 and 572 intervals,
after 2, 4 and 7 solves.
"""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.layout import Indices
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import Marks, Mesh, divide, inherited_nodes, restrict, widen
from airrace.optimal_control.replay import Replay, estimate_error, interval_durations
from airrace.procedure.certification import Evidence
from airrace.procedure.result import RefinementReason
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.zoh_error import foreseen, measured
from airrace.records import record
from airrace.trajectory import Array

SAFETY = 0.5
"""The part of a limit (1) that a mesh is made to keep, by prediction.

With 0.25 Rovinj takes 964 intervals in three solves; with 1 Air Race X takes eleven solves.
"""
SAFETY_OF_ORDER = 0.2
"""The part of the replay's limit (1) that a mesh is made to keep, by prediction.

It is smaller than `SAFETY` because on a coarse mesh the integrator does not yet converge with its order. With 0.1 and
with 0.5 the meshes of Rovinj and of the half Cuban eight differ by four intervals at most.
"""
NEARBY = 0.1
"""The part of a neighbour's integration error (1) that is expected in an interval once all intervals are halved.

The meshes of Rovinj and of the half Cuban eight are the same with 0.03 and with 0.3.
"""
FAR_OFF = 2.0
"""The multiple of its limit (1) beyond which the Hamiltonian is too far from -1.

Halving alone would then change the race time. With 1 the half Cuban eight takes 133 intervals in three solves; the
other meshes are the same with 1 and with 4.
"""
UNDERRATED = 3.0
"""The factor (1) by which a coarse mesh underrates the price of holding the controls.

Summed over a race, the estimate of `holding.foreseen` is a third to two thirds of what halving all intervals gains.
With 1 Rovinj takes 753 intervals and with 6 it takes 851, in as many solves.
"""
AHEAD_OF_ORDER = 0.3
"""The part of the replay's limit (1) from which on an interval is cut before it misses it.

The optimum on the next mesh is another one, and the errors of its intervals with it. A fifth to a half of the intervals
of a stage's first mesh miss the limit on the shipped courses. When these were cut as well, all 24 stages below the last
kept it on the next mesh, by a factor of four, on 19 % fewer intervals than with all of them halved.
"""
AHEAD = 0.1
"""The part of the Hamiltonian's limit (1) from which on an interval is halved before it misses it.

With a half, 5 of those 24 stages missed it on the next mesh; with a tenth 3, as many as with all intervals halved.
"""
CALM = 1 / 40
"""The part of the Hamiltonian's limit (1) below which half of the nodes are enough.

With a quarter of it Rovinj and Air Race X take 936 and 690 intervals; with four times as much 631 and 512, and race
times that differ by 1e-4 and 3e-4 s.
"""
AT_REST = 1 / 32
"""The part of its limit (1) below which an excess between nodes allows a node to be dropped.

It becomes four times as large when a node is dropped. With a quarter of it Air Race X takes 586 intervals; the other
meshes are the same, and with four times as much all of them are.
"""
PARTS_MAX = 6
"""The largest number of parts into which an interval is cut at once."""
WORTHWHILE = 0.85
"""The part of the nodes (1) that a coarser mesh may keep to be worth a solve for that reason alone.

All meshes are the same with 0.7 and with 0.95.
"""
UNTRUSTED_DEFECT = 1e-2
"""The largest deviation of a replayed interval (scaled) of an optimum that can be trusted.

An optimum that deviates more has exploited the error of that interval. The meshes of Rovinj and of the half Cuban
eight are the same with 1e-3 and with 0.1.
"""
LONGEST_JOINED = 0.6
"""The longest interval that comes of joining two, s.

With 0.3 s Rovinj and Air Race X take 878 and 640 intervals, with 1.2 s 806 and 567.
"""
FEWEST = 4
"""The smallest number of intervals to which joining reduces a phase."""


@record
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

    @classmethod
    def first(cls, problem: Problem, guess: Iterate) -> Self:
        """Return the mesh that a stage begins with."""
        why = np.full(problem.intervals, RefinementReason.FIRST, dtype=np.int8)
        return cls(problem.mesh, guess, why, np.ones(problem.intervals + 1, dtype=np.bool_))


@record
class MeshSolution:
    """An optimum on a draft, and its measurements."""

    problem: Problem
    iterate: Iterate
    draft: MeshProposal
    evidence: Evidence

    @property
    def race_time(self) -> float:
        """The race time, s."""
        return float(self.iterate.durations.sum())


def adapted(optimum: MeshSolution, limits: CertificateLimits, *, early: bool, joining: bool) -> MeshProposal | None:
    """Return a better first mesh; None if the present one will do.

    Args:
        early: whether a mesh that is merely not good yet is worth another solve.
        joining: whether nodes may be dropped.
    """
    drift, integration = optimum.evidence.drift, optimum.evidence.integration
    held, change = UNDERRATED * foreseen(optimum.problem, optimum.iterate), limits.race_time_of(optimum.race_time)
    untrusted = ~(optimum.evidence.check.defect <= UNTRUSTED_DEFECT)
    wanted = [
        (RefinementReason.INTEGRATION, np.where(widen(untrusted), 4.0, 1.0)),
        (RefinementReason.HAMILTONIAN, _stepped(_worst_nearby(drift), SAFETY * limits.hamiltonian)),
        (RefinementReason.RACE_TIME, np.where(_dearest(held + np.abs(integration), SAFETY * change), 2.0, 1.0)),
    ]
    parts, why = _most(optimum, wanted)
    joined = _calm_pairs(optimum, parts, limits) if joining else np.zeros(len(parts), dtype=np.bool_)
    far_off = bool((drift > FAR_OFF * limits.hamiltonian).any()) or held.sum() + abs(integration.sum()) > change
    worthwhile = parts.sum() - joined.sum() < WORTHWHILE * len(parts)
    if not untrusted.any() and not (early and far_off) and not worthwhile:
        return None
    divided = _divided(optimum, parts, why)
    dropped = np.flatnonzero(joined) + 1
    kept = np.ones(int(parts.sum()) + 1, dtype=np.bool_)
    kept[_places(parts)[dropped]] = False
    return _restricted(divided, kept, RefinementReason.CALM)


def bisect_all(optimum: MeshSolution, limits: CertificateLimits) -> MeshProposal:
    """Return a mesh with all intervals halved at least, and cut into as many parts as they are expected to need."""
    parts, why = _needed(optimum, limits, nearby=NEARBY)
    parts = np.maximum(parts, 2)
    divided = _divided(optimum, parts, why)
    return MeshProposal(divided.mesh, divided.guess, divided.why, inherited_nodes(parts))


def doubled(draft: MeshProposal, flown: Replay | None = None) -> MeshProposal:
    """Everywhere finer by half, at least, than the coarser mesh behind a draft; what is so already stays as it is.

    Args:
        flown: its controls flown again, for states at the new nodes; None for states straight between the old ones.
    """
    sizes = np.diff(np.flatnonzero(draft.coarser))
    parts = np.where(sizes == 1, 2, 1).astype(np.int64)[np.cumsum(draft.coarser[:-1]) - 1]
    mesh, guess = divide(draft.mesh, draft.guess, flown, parts)
    return MeshProposal(mesh, guess, np.repeat(draft.why, parts), _still_coarser(draft, parts))


def refine_flagged(optimum: MeshSolution, limits: CertificateLimits) -> MeshProposal | None:
    """Return a mesh that is finer where something is wrong between nodes; None if nothing is."""
    parts, why = _needed(optimum, limits, nearby=1.0)
    return None if (parts == 1).all() else _cut(optimum, parts, why)


def refine_predicted(optimum: MeshSolution, limits: CertificateLimits) -> MeshProposal | None:
    """Return a mesh that is finer where something is wrong between nodes or nearly so; None if nothing is wrong.

    The optimum on it is expected to keep all limits, where a mesh that is merely mended often misses another one.
    """
    parts, why = _needed(optimum, limits, nearby=1.0)
    if (parts == 1).all():
        return None
    evidence = optimum.evidence
    ahead = [
        (RefinementReason.INTEGRATION, _doubled_above(evidence.check.defect, AHEAD_OF_ORDER * limits.replay)),
        (RefinementReason.HAMILTONIAN, _doubled_above(evidence.drift, AHEAD * limits.hamiltonian)),
    ]
    more, reasons = _most(optimum, ahead)
    return _cut(optimum, np.maximum(parts, more), np.where(more > parts, reasons, why).astype(np.int8))


def provided(draft: MeshProposal, problem: Problem, limits: CertificateLimits) -> MeshProposal:
    """Return a mesh that is finer where the integrator's error would break its limit, before it is solved on.

    That is estimated from the guess.

    Args:
        problem: on the mesh of the draft.
    """
    error = np.abs(estimate_error(problem, draft.guess)).max(axis=0)
    parts = np.where(error > SAFETY * limits.replay, 2, 1).astype(np.int64)
    mesh, guess = divide(draft.mesh, draft.guess, None, parts)
    why = np.where(parts > 1, RefinementReason.INTEGRATION, draft.why).astype(np.int8)
    return MeshProposal(mesh, guess, np.repeat(why, parts), _still_coarser(draft, parts))


def reconsidered(optimum: MeshSolution, before: MeshSolution, limits: CertificateLimits) -> MeshProposal:
    """Return a better first mesh from an optimum whose race time differs too much from that on the mesh before.

    The intervals that are taken to have changed it most stay as fine as they are, all others become what they were.
    """
    max_plan_penalty = widen(_dearest(_changed_by(optimum, before), SAFETY * limits.race_time_of(optimum.race_time)))
    fine = max_plan_penalty[np.cumsum(optimum.draft.coarser[:-1]) - 1]
    kept = optimum.draft.coarser.copy()
    kept[:-1] |= fine
    why = np.where(fine, RefinementReason.RACE_TIME, optimum.draft.why).astype(np.int8)
    draft = MeshProposal(optimum.draft.mesh, optimum.iterate, why, optimum.draft.coarser)
    return _restricted(draft, kept)


def _changed_by(optimum: MeshSolution, before: MeshSolution) -> Array:
    """Estimate what the intervals of the mesh before have changed of the race time, s; shape (N before,).

    What is not the integrator's error is due to controls that are held less long, if the finer mesh is faster; if it is
    slower, to limits that are kept at more nodes.
    """
    integration = before.evidence.integration
    changed = optimum.race_time - before.race_time
    if changed < 0.0:
        price = measured(optimum.problem, optimum.iterate, optimum.draft.coarser)
    else:
        price = before.evidence.check.excess * interval_durations(before.problem, before.iterate.durations)
    share = price / price.sum() if price.any() else np.full(len(price), 1.0 / len(price))
    return np.abs(integration) + abs(changed - integration.sum()) * share


def _dearest(price: Array, limit: float) -> Marks:
    """Return the intervals that cost most, so many that the others together keep within a limit; shape (N,)."""
    order = np.argsort(-price)
    left = price.sum() - np.cumsum(price[order])
    max_plan_penalty = np.zeros(len(price), dtype=np.bool_)
    if price.sum() > limit:
        max_plan_penalty[order[: int(np.argmax(left <= limit)) + 1]] = True
    return max_plan_penalty


def _needed(optimum: MeshSolution, limits: CertificateLimits, *, nearby: float) -> tuple[Indices, NDArray[np.int8]]:
    """Return the number of parts that each interval needs for every indicator to keep its limit, and the reason.

    Args:
        nearby: how much of the integration error beside an interval is expected in it.
    """
    evidence = optimum.evidence
    order = optimum.problem.scheme.order + 1  # of what is left in one interval
    defect = np.maximum(evidence.check.defect, nearby * _worst_nearby(evidence.check.defect))
    integration = np.ceil((defect / (SAFETY_OF_ORDER * limits.replay)) ** (1 / order))
    integration = np.where(defect <= limits.replay, 1, np.maximum(integration, 2))
    wanted = [
        (RefinementReason.INTEGRATION, integration),
        (RefinementReason.LIMITS, _stepped(_worst_nearby(evidence.check.excess), 1.0)),
        (
            RefinementReason.HAMILTONIAN,
            np.where(_worst_nearby(evidence.drift) <= limits.hamiltonian, 1.0, 4.0),
        ),  # it falls slowly
    ]
    return _most(optimum, wanted)


def _most(optimum: MeshSolution, wanted: list[tuple[RefinementReason, Array]]) -> tuple[Indices, NDArray[np.int8]]:
    """Return the largest number of parts that any indicator asks for in each interval, and which indicator it is."""
    counts = np.nan_to_num(np.stack([count for _, count in wanted]), nan=PARTS_MAX, posinf=PARTS_MAX)
    parts = np.clip(counts.max(axis=0), 1, PARTS_MAX).astype(np.int64)
    reasons = np.array([why for why, _ in wanted], dtype=np.int8)[counts.argmax(axis=0)]
    return parts, np.where(parts > 1, reasons, optimum.draft.why).astype(np.int8)


def _doubled_above(values: Array, limit: float) -> Array:
    """Return two parts where a limit is exceeded in an interval or beside it."""
    return np.where(_worst_nearby(values) <= limit, 1.0, 2.0)


def _stepped(values: Array, limit: float) -> Array:
    """Return two parts where a limit is exceeded, four where it is exceeded by far."""
    return np.where(values <= limit, 1.0, np.where(values <= 4.0 * limit, 2.0, 4.0))


def _worst_nearby(values: Array) -> Array:
    """Return the largest value of each interval and those beside it.

    Where one interval alone is made finer, the error moves to the next.
    """
    worst = values.copy()
    worst[1:] = np.maximum(worst[1:], values[:-1])
    worst[:-1] = np.maximum(worst[:-1], values[1:])
    return worst


def _calm_pairs(optimum: MeshSolution, parts: Indices, limits: CertificateLimits) -> Marks:
    """Return the intervals that may be joined with the next one; shape (N,).

    That one is not joined with another.
    """
    problem, evidence = optimum.problem, optimum.evidence
    busy = (
        widen(parts > 1)
        | (interval_durations(problem, optimum.iterate.durations) > 0.5 * LONGEST_JOINED)
        | (_worst_nearby(evidence.drift) >= CALM * limits.hamiltonian)
        | (evidence.check.defect >= 0.5 * SAFETY * limits.replay)
        | (evidence.check.excess >= AT_REST)
    )
    joined = np.zeros(problem.intervals, dtype=np.bool_)
    for first, last in zip(problem.first_node, problem.first_node[1:], strict=False):
        left, interval = last - first, first
        while interval + 1 < last and left > FEWEST:
            if busy[interval] or busy[interval + 1]:
                interval += 1
            else:
                joined[interval] = True
                left, interval = left - 1, interval + 2
    return joined


def _divided(optimum: MeshSolution, parts: Indices, why: NDArray[np.int8]) -> MeshProposal:
    mesh, guess = divide(optimum.problem.mesh, optimum.iterate, optimum.evidence.flown, parts)
    return MeshProposal(mesh, guess, np.repeat(why, parts), np.ones(int(parts.sum()) + 1, dtype=np.bool_))


def _cut(optimum: MeshSolution, parts: Indices, why: NDArray[np.int8]) -> MeshProposal:
    """Return a finer mesh with the same coarser one behind it."""
    divided = _divided(optimum, parts, why)
    return MeshProposal(divided.mesh, divided.guess, divided.why, _still_coarser(optimum.draft, parts))


def _restricted(draft: MeshProposal, kept: Marks, why_joined: RefinementReason | None = None) -> MeshProposal:
    """Return a first mesh without the nodes that are not kept.

    Without another reason, joined intervals keep their own.
    """
    mesh, guess = restrict(draft.mesh, draft.guess, kept)
    why = draft.why[kept[:-1]]
    if why_joined is not None:
        alone = np.bincount(np.cumsum(kept[:-1]) - 1) == 1
        why = np.where(alone, why, why_joined).astype(np.int8)
    return MeshProposal(mesh, guess, why, np.ones(int(kept.sum()), dtype=np.bool_))


def _still_coarser(draft: MeshProposal, parts: Indices) -> Marks:
    """Return the nodes of the coarser mesh behind a draft, when its intervals are cut into so many parts."""
    coarser = np.zeros(int(parts.sum()) + 1, dtype=np.bool_)
    coarser[_places(parts)] = draft.coarser
    return coarser


def _places(parts: Indices) -> Indices:
    """Return the places of the old nodes in a divided mesh, shape (N + 1,)."""
    return np.concatenate([[0], np.cumsum(parts)])
