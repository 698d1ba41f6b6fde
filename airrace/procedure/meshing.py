"""Which mesh comes next: coarser where nothing happens, finer where something is wrong, until an optimum is proved.

A first mesh is adapted until the Hamiltonian keeps near to -1 all along it; then all of its intervals are halved at
least. What the finer optimum gains in race time is what a mesh still does to the result. If that is too much, the
intervals that gained go back into the first mesh as fine as they are now.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.layout import Indices
from airrace.optimal_control.problem import Iterate, Problem
from airrace.optimal_control.refinement import Marks, Mesh, divide, inherited, restrict, widened
from airrace.optimal_control.replay import Replay, estimated_error, interval_durations
from airrace.procedure.certification import Evidence
from airrace.procedure.holding import foreseen, measured
from airrace.procedure.result import Why
from airrace.procedure.settings import CertificateLimits
from airrace.trajectory import Array

SAFETY = 0.5  # of a limit: what a mesh is made to keep, by prediction
SAFETY_OF_ORDER = 0.2  # likewise of the replay: on a coarse mesh the integrator is not yet of its order
NEARBY = 0.1  # of the integration error beside an interval is expected in it on a mesh of half the intervals
FAR_OFF = 2.0  # times its limit: where the Hamiltonian is so far from -1, halving alone would change the race time
UNDERRATED = 3.0  # the price of holding the controls is, seen from a coarse mesh
CALM = 1 / 40  # of the limit of the Hamiltonian: less than that, and half of the nodes will do
AT_REST = 1 / 32  # of a limit: an excess between nodes becomes four times as much when a node is dropped
PARTS_MAX = 6
WORTHWHILE = 0.85  # of the nodes: if no more than that are left, a mesh is made coarser for that alone
UNTRUE = 1e-2  # scaled, of a replay: an optimum that is so far off in an interval is made of what is wrong there
LONGEST_JOINED = 0.6  # s
FEWEST = 4  # intervals in a phase that are left


@dataclass(frozen=True)
class Draft:
    """A mesh to be solved on, with a guess.

    Attributes:
        mesh: fractions of every phase.
        guess: on it.
        why: a `Why` per interval, shape (N,).
        coarser: which nodes belong to the mesh that this one was divided from, shape (N + 1,).
    """

    mesh: Mesh
    guess: Iterate
    why: NDArray[np.int8]
    coarser: Marks

    @classmethod
    def first(cls, problem: Problem, guess: Iterate) -> Self:
        """The mesh that a stage begins with."""
        why = np.full(problem.intervals, Why.FIRST, dtype=np.int8)
        return cls(problem.mesh, guess, why, np.ones(problem.intervals + 1, dtype=np.bool_))


@dataclass(frozen=True)
class Solved:
    """An optimum on a draft, and what is measured of it."""

    problem: Problem
    iterate: Iterate
    draft: Draft
    evidence: Evidence

    @property
    def race_time(self) -> float:
        return float(self.iterate.durations.sum())


def adapted(optimum: Solved, limits: CertificateLimits, *, early: bool, joining: bool) -> Draft | None:
    """A better first mesh, None if the one there is will do.

    Args:
        early: whether a mesh that is merely not good yet is worth another solve.
        joining: whether nodes may be dropped.
    """
    drift, integration = optimum.evidence.drift, optimum.evidence.integration
    held = UNDERRATED * foreseen(optimum.problem, optimum.iterate)
    untrue = ~(optimum.evidence.audit.defect <= UNTRUE)
    wanted = [
        (Why.INTEGRATION, np.where(widened(untrue), 4.0, 1.0)),
        (Why.HAMILTONIAN, _stepped(_worst_nearby(drift), SAFETY * limits.hamiltonian)),
        (Why.RACE_TIME, np.where(_dearest(held + np.abs(integration), SAFETY * limits.race_time), 2.0, 1.0)),
    ]
    parts, why = _most(optimum, wanted)
    joined = _calm_pairs(optimum, parts, limits) if joining else np.zeros(len(parts), dtype=np.bool_)
    far_off = (
        bool((drift > FAR_OFF * limits.hamiltonian).any()) or held.sum() + abs(integration.sum()) > limits.race_time
    )
    worthwhile = parts.sum() - joined.sum() < WORTHWHILE * len(parts)
    if not untrue.any() and not (early and far_off) and not worthwhile:
        return None
    divided = _divided(optimum, parts, why)
    dropped = np.flatnonzero(joined) + 1
    kept = np.ones(int(parts.sum()) + 1, dtype=np.bool_)
    kept[_places(parts)[dropped]] = False
    return _restricted(divided, kept, Why.CALM)


def halved(optimum: Solved, limits: CertificateLimits) -> Draft:
    """All intervals halved at least, and cut into as many parts as they are expected to need."""
    parts, why = _needed(optimum, limits, nearby=NEARBY)
    parts = np.maximum(parts, 2)
    divided = _divided(optimum, parts, why)
    return Draft(divided.mesh, divided.guess, divided.why, inherited(parts))


def doubled(draft: Draft, flown: Replay | None = None) -> Draft:
    """Everywhere finer by half, at least, than the coarser mesh behind a draft; what is so already stays as it is.

    Args:
        flown: its controls flown again, for states at the new nodes; None for states straight between the old ones.
    """
    sizes = np.diff(np.flatnonzero(draft.coarser))
    parts = np.where(sizes == 1, 2, 1).astype(np.int64)[np.cumsum(draft.coarser[:-1]) - 1]
    mesh, guess = divide(draft.mesh, draft.guess, flown, parts)
    return Draft(mesh, guess, np.repeat(draft.why, parts), _still_coarser(draft, parts))


def mended(optimum: Solved, limits: CertificateLimits) -> Draft | None:
    """Finer where something is wrong between nodes; None if nothing is."""
    parts, why = _needed(optimum, limits, nearby=1.0)
    if (parts == 1).all():
        return None
    divided = _divided(optimum, parts, why)
    return Draft(divided.mesh, divided.guess, divided.why, _still_coarser(optimum.draft, parts))


def provided(draft: Draft, problem: Problem, limits: CertificateLimits) -> Draft:
    """Finer where the guess lets foresee that the integrator's error would break its limit, before it is solved on.

    Args:
        problem: on the mesh of the draft.
    """
    error = np.abs(estimated_error(problem, draft.guess)).max(axis=0)
    parts = np.where(error > SAFETY * limits.replay, 2, 1).astype(np.int64)
    mesh, guess = divide(draft.mesh, draft.guess, None, parts)
    why = np.where(parts > 1, Why.INTEGRATION, draft.why).astype(np.int8)
    return Draft(mesh, guess, np.repeat(why, parts), _still_coarser(draft, parts))


def reconsidered(optimum: Solved, before: Solved, limits: CertificateLimits) -> Draft:
    """A better first mesh from an optimum whose race time has changed too much from that on the mesh before: what is
    taken to have changed it most stays as fine as it is, all else becomes what it was."""
    dearest = widened(_dearest(_changed_by(optimum, before), SAFETY * limits.race_time))
    fine = dearest[np.cumsum(optimum.draft.coarser[:-1]) - 1]
    kept = optimum.draft.coarser.copy()
    kept[:-1] |= fine
    why = np.where(fine, Why.RACE_TIME, optimum.draft.why).astype(np.int8)
    draft = Draft(optimum.draft.mesh, optimum.iterate, why, optimum.draft.coarser)
    return _restricted(draft, kept)


def _changed_by(optimum: Solved, before: Solved) -> Array:
    """What the intervals of the mesh before are taken to have changed of the race time, s; shape (N before,).

    What is not the integrator's error is due to controls that are held less long, if the finer mesh is faster; if it is
    slower, to limits that are kept at more nodes.
    """
    integration = before.evidence.integration
    changed = optimum.race_time - before.race_time
    if changed < 0.0:
        price = measured(optimum.problem, optimum.iterate, optimum.draft.coarser)
    else:
        price = before.evidence.audit.excess * interval_durations(before.problem, before.iterate.durations)
    share = price / price.sum() if price.any() else np.full(len(price), 1.0 / len(price))
    return np.abs(integration) + abs(changed - integration.sum()) * share


def _dearest(price: Array, limit: float) -> Marks:
    """Those that cost most, so many that the others together cost no more than a limit; shape (N,)."""
    order = np.argsort(-price)
    left = price.sum() - np.cumsum(price[order])
    dearest = np.zeros(len(price), dtype=np.bool_)
    if price.sum() > limit:
        dearest[order[: int(np.argmax(left <= limit)) + 1]] = True
    return dearest


def _needed(optimum: Solved, limits: CertificateLimits, *, nearby: float) -> tuple[Indices, NDArray[np.int8]]:
    """How many parts every interval needs for each indicator to keep its limit, and for which of them.

    Args:
        nearby: how much of the integration error beside an interval is expected in it.
    """
    evidence = optimum.evidence
    order = optimum.problem.scheme.order + 1  # of what is left in one interval
    defect = np.maximum(evidence.audit.defect, nearby * _worst_nearby(evidence.audit.defect))
    integration = np.ceil((defect / (SAFETY_OF_ORDER * limits.replay)) ** (1 / order))
    integration = np.where(defect <= limits.replay, 1, np.maximum(integration, 2))
    wanted = [
        (Why.INTEGRATION, integration),
        (Why.LIMITS, _stepped(_worst_nearby(evidence.audit.excess), 1.0)),
        (Why.HAMILTONIAN, np.where(_worst_nearby(evidence.drift) <= limits.hamiltonian, 1.0, 4.0)),  # it falls slowly
    ]
    return _most(optimum, wanted)


def _most(optimum: Solved, wanted: list[tuple[Why, Array]]) -> tuple[Indices, NDArray[np.int8]]:
    """The largest number of parts that anything wants of each interval, and what wants it."""
    counts = np.nan_to_num(np.stack([count for _, count in wanted]), nan=PARTS_MAX, posinf=PARTS_MAX)
    parts = np.clip(counts.max(axis=0), 1, PARTS_MAX).astype(np.int64)
    reasons = np.array([why for why, _ in wanted], dtype=np.int8)[counts.argmax(axis=0)]
    return parts, np.where(parts > 1, reasons, optimum.draft.why).astype(np.int8)


def _stepped(values: Array, limit: float) -> Array:
    """Two parts where a limit is exceeded, four where by far."""
    return np.where(values <= limit, 1.0, np.where(values <= 4.0 * limit, 2.0, 4.0))


def _worst_nearby(values: Array) -> Array:
    """Of each interval and those beside it: where one alone is made finer, what is wrong moves to the next."""
    worst = values.copy()
    worst[1:] = np.maximum(worst[1:], values[:-1])
    worst[:-1] = np.maximum(worst[:-1], values[1:])
    return worst


def _calm_pairs(optimum: Solved, parts: Indices, limits: CertificateLimits) -> Marks:
    """Intervals that may be joined with the next one, which then is not joined with another; shape (N,)."""
    problem, evidence = optimum.problem, optimum.evidence
    busy = (
        widened(parts > 1)
        | (interval_durations(problem, optimum.iterate.durations) > 0.5 * LONGEST_JOINED)
        | (_worst_nearby(evidence.drift) >= CALM * limits.hamiltonian)
        | (evidence.audit.defect >= 0.5 * SAFETY * limits.replay)
        | (evidence.audit.excess >= AT_REST)
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


def _divided(optimum: Solved, parts: Indices, why: NDArray[np.int8]) -> Draft:
    mesh, guess = divide(optimum.problem.mesh, optimum.iterate, optimum.evidence.flown, parts)
    return Draft(mesh, guess, np.repeat(why, parts), np.ones(int(parts.sum()) + 1, dtype=np.bool_))


def _restricted(draft: Draft, kept: Marks, why_joined: Why | None = None) -> Draft:
    """A first mesh without the nodes that are not kept; without another reason, joined intervals keep their own."""
    mesh, guess = restrict(draft.mesh, draft.guess, kept)
    why = draft.why[kept[:-1]]
    if why_joined is not None:
        alone = np.bincount(np.cumsum(kept[:-1]) - 1) == 1
        why = np.where(alone, why, why_joined).astype(np.int8)
    return Draft(mesh, guess, why, np.ones(int(kept.sum()), dtype=np.bool_))


def _still_coarser(draft: Draft, parts: Indices) -> Marks:
    """The nodes of the coarser mesh behind a draft, when its intervals are cut into so many parts."""
    coarser = np.zeros(int(parts.sum()) + 1, dtype=np.bool_)
    coarser[_places(parts)] = draft.coarser
    return coarser


def _places(parts: Indices) -> Indices:
    """Of the old nodes in a divided mesh, shape (N + 1,)."""
    return np.concatenate([[0], np.cumsum(parts)])
