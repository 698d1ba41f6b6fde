"""The multipliers of limits, carried over from one mesh of a race to another, or to the same race with other numbers.

A limit that holds along a phase has a multiplier per node whose size goes with the stretch of time that the node stands
for; its density is carried over. Conditions at the nodes between phases are carried over as they are. Multipliers of
the dynamics are left at zero: a solver finds them from those of the limits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.refinement import Marks
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.records import record
from airrace.trajectory import Array, Indices

Extent = Literal["end", "node", "interval", "duration", "one node"]
"""Where a limit holds: where phases meet, at the nodes between these, over intervals, for a whole phase, at one node
alone."""


@record
class LimitPlaces:
    """A limit on one quantity, in n places.

    Attributes:
        places: of its multipliers in those of (g, w), shape (n,).
        along: where, in phases from the start, shape (n,), ascending.
        weights: from densities in SI to multipliers, shape (n,).
    """

    places: Indices
    along: Array
    weights: Array


Limits = Mapping[tuple[Extent, str], LimitPlaces]
"""All limits of a problem, by their extents and names."""


def transfer_multipliers(multipliers: Multipliers, there: Layout, here: Layout) -> Multipliers:
    """Return the multipliers for another problem with as many phases.

    Args:
        multipliers: of a solved problem.
        there: its layout.
        here: the layout of the problem that they are wanted for. Limits that the other one does not have get zero.
    """
    known = np.concatenate([multipliers.constraints, multipliers.bounds])
    wanted = np.zeros(here.constraints + here.unknowns)
    before = limits_of(there)
    for (extent, name), limit in limits_of(here).items():
        if source := before.get((extent, name)):
            density = known[source.places] / source.weights
            if extent == "one node":  # which may be another one
                same = len(limit.places) == len(source.places)
                wanted[limit.places] = limit.weights * density if same else 0.0
            else:
                at = _same if extent in ("end", "duration") else _interpolate
                wanted[limit.places] = limit.weights * at(limit.along, source.along, density)
    return Multipliers(wanted[: here.constraints], wanted[here.constraints :])


def limits_of(layout: Layout) -> Limits:
    """Return all limits of a problem."""
    halves = layout.fractions / 2.0
    stretch = np.append(halves, 0.0) + np.append(0.0, halves)  # the part of a phase that each node stands for
    along = np.concatenate([[0.0], np.cumsum(layout.fractions)])
    at_end = np.zeros(layout.intervals + 1, dtype=np.bool_)
    stretch[layout.first_node], at_end[layout.first_node] = 1.0, True
    along[layout.first_node] = np.arange(len(layout.first_node))  # exact where phases meet
    limits: dict[tuple[Extent, str], LimitPlaces] = {}
    rows = layout.rows
    sources, source = _number([*(one.name for one in layout.output_samples), "path"])  # the path is the last: -1
    names, name = _number([one.quantity.name for one in rows.limits])
    number = (source[rows.source] * len(names) + name[rows.number]) * 2 + at_end[rows.node]
    order = np.argsort(number, kind="stable")  # rows are in the order of their nodes
    weight = stretch[rows.node] * rows.scale
    alone = {
        f"{phase.name}, {one.name}" for phase in layout.problem.phases for one in phase.watches if one.at is not None
    }
    for members in np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else ():
        which, end = divmod(int(number[members[0]]), 2)
        sampled = sources[which // len(names)]
        key = f"{sampled}: {names[which % len(names)]}"
        limit = LimitPlaces(layout.row_index[members], along[rows.node[members]], weight[members])
        if sampled in alone:
            limits["one node", key] = replace(limit, weights=rows.scale[members])
        else:
            limits["end" if end else "node", key] = limit
    by_extent: dict[Extent, Marks] = {"end": at_end, "node": ~at_end}
    for component, quantity in enumerate(layout.problem.system.states):
        places, weights = layout.constraints + layout.state_index[:, component], stretch * quantity.scale
        for extent, nodes in by_extent.items():
            limits[extent, f"state: {quantity.name}"] = LimitPlaces(places[nodes], along[nodes], weights[nodes])
    ends = along[:-1] + layout.fractions  # the last interval of a phase ends where the next phase begins
    for component, quantity in enumerate(layout.problem.system.controls):
        places, weights = layout.constraints + layout.control_index[:, component], layout.fractions * quantity.scale
        limits["interval", f"control: {quantity.name}"] = LimitPlaces(places, (along[:-1] + ends) / 2.0, weights)
    places = layout.constraints + layout.phase_durations
    limits["duration", "duration"] = LimitPlaces(places, np.arange(float(len(places))), np.ones(len(places)))
    return limits


def _number(names: Sequence[str]) -> tuple[list[str], Indices]:
    """Return the different names, and the number of each one among them."""
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return list(numbers), np.array([numbers[name] for name in names], dtype=np.int64)


def _same(along: Array, known_along: Array, density: Array) -> Array:
    """Return the densities known at the very same places, zero at others."""
    at = np.maximum(np.searchsorted(known_along, along, side="right") - 1, 0)
    return np.where(known_along[at] == along, density[at], 0.0)


def _interpolate(along: Array, known_along: Array, density: Array) -> Array:
    """Return densities straight between the known ones of the same phase; zero in a phase without any."""
    result = np.zeros(len(along))
    phases, known_phases = np.floor(along), np.floor(known_along)
    for phase in np.intersect1d(phases, known_phases):
        here, there = phases == phase, known_phases == phase
        result[here] = np.interp(along[here], known_along[there], density[there])
    return result
