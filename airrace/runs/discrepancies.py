"""The discrepancies between a stage as it is stored and as it was measured again, in words."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields

import numpy as np

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Certificate, Item
from airrace.procedure.result import GateSplit, StageResult
from airrace.quantities import Quantity
from airrace.trajectory import Array

ROUNDED = 1e-6
"""The largest difference between two evaluations of one formula, as a fraction of the value, or of 1 where that is
less. Meshes are stored as times, so the fractions of their phases come back rounded; measured: 3e-8."""
INTEGRATED = 1e-3
"""The largest difference between two measurements of one flight, as a fraction of the value. An integrator may choose
another step on another machine; on one machine the largest difference was 3e-8."""
NOTHING = 1e-6
"""The share of an item's limit below which a value is nothing but rounding."""
SOLVED_AGAIN = 2e-2
"""The share of its limit for the race time on a coarser mesh, which is solved for anew from another start: 1e-4 s.

Optima that are found from different starts, all within the solver's tolerance, differ by what an interior point method
leaves of its barrier. Measured: 7e-7 s on a course of 9 s, 8e-5 s on Abu Dhabi in a wind, a race of 53 s.
"""
TOLD = 4
"""The number of discrepancies that a sentence tells one by one."""


def discrepancies(stored: StageResult, again: StageResult) -> list[str]:
    """Return a clause for everything that is stored otherwise than it was measured; nothing where all agrees.

    Args:
        stored: the stage as it was read.
        again: what follows from its histories and multipliers, see `airrace.procedure.recomputation`.
    """
    found = [*_flight(stored, again), *_splits(stored.splits, again.splits), *_numbers(stored, again)]
    if stored.certificate is not None and again.certificate is not None:
        found += _certificate(stored.certificate, again.certificate)
    elif stored.certificate is not again.certificate:
        found.append("it has no certificate" if stored.certificate is None else "a guess has a certificate")
    for number, (alternative, measured) in enumerate(
        zip(stored.alternatives, again.alternatives, strict=True), start=1
    ):
        found += [f"alternative {number}: {clause}" for clause in discrepancies(alternative, measured)]
    return found


def in_one_sentence(clauses: Sequence[str]) -> str:
    """Return clauses as one; of many only the first are told."""
    told, more = "; ".join(clauses[:TOLD]), len(clauses) - TOLD
    return f"{told}; and {more} more" if more > 0 else told


def _flight(stored: StageResult, again: StageResult) -> Iterator[str]:
    mine, its = stored.trajectory, again.trajectory
    yield from _declared("state", mine.states, its.states)
    yield from _declared("control", mine.controls, its.controls)
    for name, called in zip(mine.phases, its.phases, strict=True):
        if name != called:
            yield f"a leg is called {name!r}, and the course calls it {called!r}"
    yield from _series("time", mine.time, its.time, ROUNDED * 1e-3 * its.race_time)


def _declared(kind: str, stored: Sequence[Quantity], declared: Sequence[Quantity]) -> Iterator[str]:
    for mine, other in zip(stored, declared, strict=True):
        others = [one.name for one in fields(Quantity) if getattr(mine, one.name) != getattr(other, one.name)]
        if others:
            yield f"the {kind} {mine.name} is declared with another {', '.join(others)}"


def _splits(stored: Sequence[GateSplit], again: Sequence[GateSplit]) -> Iterator[str]:
    if len(stored) != len(again):
        yield f"{len(stored)} gate splits are stored of {len(again)}"
        return
    for mine, its in zip(stored, again, strict=True):
        if mine.name != its.name:
            yield f"a gate split is called {mine.name!r} instead of {its.name!r}"
        for name in (one.name for one in fields(GateSplit) if one.name != "name"):
            value, measured = getattr(mine, name), getattr(its, name)
            apart = value - measured
            if name in ("bank", "heading"):
                apart = math.remainder(apart, 2.0 * math.pi) if math.isfinite(apart) else apart
            if not abs(apart) <= ROUNDED * max(1.0, abs(measured)):
                yield _two(f"gate split {its.name}, {name}", value, measured)


def _numbers(stored: StageResult, again: StageResult) -> Iterator[str]:
    mine, its = stored.provenance.regularisation, again.provenance.regularisation
    if not abs(mine - its) <= ROUNDED:
        yield _two("regularisation", mine, its)
    pressure, measured = stored.bound_multipliers, again.bound_multipliers
    largest = float(np.abs(measured).max(initial=1.0))
    yield from _series("simple bounds, multiplier", pressure, measured, ROUNDED * largest)
    for name in ("defect", "drift"):
        told, found = getattr(stored.mesh, name), getattr(again.mesh, name)
        yield from _series(f"mesh, {name}", told, found, INTEGRATED * float(np.abs(found).max(initial=0.0)))


def _series(what: str, stored: Array, again: Array, tolerance: float) -> Iterator[str]:
    """Yield a clause where two series of numbers are further apart than a tolerance at any place."""
    if stored.shape != again.shape:
        yield f"{what}: {stored.size} numbers are stored of {again.size}"
        return
    apart = np.abs(stored - again)
    if stored.size and not (apart <= tolerance).all():
        worst = int(np.nan_to_num(apart, nan=np.inf).argmax())
        yield _two(f"{what} {worst + 1}", float(stored[worst]), float(again[worst]))


def _certificate(stored: Certificate, again: Certificate) -> Iterator[str]:
    names, measured = [item.name for item in stored.items], [item.name for item in again.items]
    if names != measured:
        other = sorted(set(names) ^ set(measured))
        yield f"the stored certificate has other items{': ' if other else ', in another order'}{', '.join(other)}"
        return
    for mine, its in zip(stored.items, again.items, strict=True):
        yield from _item(mine, its)


def _item(mine: Item, its: Item) -> Iterator[str]:
    nothing = (SOLVED_AGAIN if its.name == RACE_TIME_CHANGE else NOTHING) * its.limit
    if not abs(mine.value - its.value) <= nothing + INTEGRATED * abs(its.value):
        yield _two(f"certificate, {its.name}", mine.value, its.value)
    if not abs(mine.limit - its.limit) <= ROUNDED * abs(its.limit):
        yield _two(f"certificate, limit of {its.name}", mine.limit, its.limit)
    elsewhere = mine.where != its.where and (its.value > nothing or its.limit == 0.0)
    if mine.unit != its.unit or elsewhere:
        told, found = (" ".join((one.unit, one.where)).strip() or "nothing" for one in (mine, its))
        yield f"certificate, unit and place of {its.name}: {told} is stored, {found} was measured"


def _two(name: str, stored: float, measured: float) -> str:
    return f"{name}: {stored:.6g} is stored, {measured:.6g} was measured"
