"""Meshes made finer and coarser, and a solution and its multipliers carried over to them or to another race.

A limit that holds along a phase has a multiplier per node whose size goes with the stretch of time that the node stands
for; its density is carried over. Conditions at the nodes between phases are carried over as they are. Multipliers of
the dynamics are left at zero: a solver finds them from those of the limits.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.layout import Layout
from airrace.optimal_control.problem import Iterate, uniform
from airrace.optimal_control.replay import SAMPLES, Replay
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.optimal_control.trajectory import Array, Indices

Fractions = tuple[float, ...]
Mesh = list[Fractions]
Marks = NDArray[np.bool_]
LEAST_SHARE = 0.2
"""The share of its length that an interval keeps at least when nodes are moved (1)."""


def divide(mesh: Sequence[Fractions], iterate: Iterate, replay: Replay | None, parts: Indices) -> tuple[Mesh, Iterate]:
    """Cut every interval into so many equal parts; `parts` has shape (N,).

    Returns:
        The new mesh, and the iterate on it: the new nodes lie on the replayed flight, or without one straight between
        those that there were.
    """
    ends = np.cumsum([0, *(len(phase) for phase in mesh)]).tolist()
    finer: Mesh = []
    for phase, (first, last) in zip(mesh, itertools.pairwise(ends), strict=True):
        counts = parts[first:last]
        finer.append(tuple(np.repeat(np.asarray(phase) / counts, counts).tolist()))
    parent = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(parent)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[parent]
    if replay is None:
        between = iterate.state[:, parent] * (1.0 - share) + iterate.state[:, parent + 1] * share
    else:
        place = share * SAMPLES
        before = np.minimum(place.astype(np.int64), SAMPLES - 1)
        weight = place - before
        between = replay.state[:, parent, before] * (1.0 - weight) + replay.state[:, parent, before + 1] * weight
    state = np.hstack([between, iterate.state[:, -1:]])
    state[:, inherited_nodes(parts)] = iterate.state
    return finer, Iterate(iterate.durations, state, iterate.control[:, parent])


def restrict(mesh: Sequence[Fractions], iterate: Iterate, nodes: Marks) -> tuple[Mesh, Iterate]:
    """Drop nodes: intervals without a node between them become one, with the mean of their controls.

    Args:
        nodes: which nodes remain, shape (N + 1,); those between phases have to.

    Raises:
        ValueError: a node between phases is to be dropped.
    """
    first_node = np.cumsum([0, *(len(phase) for phase in mesh)])
    if not nodes[first_node].all():
        raise ValueError("the nodes between phases cannot be dropped")
    fractions = np.concatenate([np.asarray(phase) for phase in mesh])
    group = np.cumsum(nodes[:-1]) - 1
    sums = np.bincount(group, weights=fractions)
    means = np.stack([np.bincount(group, weights=fractions * row) for row in iterate.control]) / sums
    ends = (np.cumsum(nodes) - 1)[first_node].tolist()
    coarser = [tuple(sums[first:last].tolist()) for first, last in itertools.pairwise(ends)]
    return coarser, Iterate(iterate.durations, iterate.state[:, nodes], means)


def resample(
    mesh: Sequence[Fractions], iterate: Iterate, counts: Sequence[int], *, jumps: Array | None = None
) -> tuple[Mesh, Iterate]:
    """Carry an iterate over to so many equal intervals in each phase; a phase that has as many already keeps its own.

    Args:
        mesh: fractions of every phase.
        iterate: on that mesh.
        counts: new numbers of intervals.
        jumps: of the states at the ends of the phases, as `Problem.jumps` has them; None for none.

    Returns:
        The new mesh, and the iterate on it: states straight between the nodes, mean controls.
    """
    first_node = np.cumsum([0, *(len(phase) for phase in mesh)])
    fractions: Mesh = []
    state: list[Array] = []
    control: list[Array] = []
    for index, (phase, count, first, last) in enumerate(zip(mesh, counts, first_node, first_node[1:], strict=False)):
        x, u = iterate.state[:, first : last + 1], iterate.control[:, first:last]
        if jumps is not None:
            x = np.hstack([x[:, :-1], x[:, -1:] - jumps[:, index : index + 1]])
        if len(phase) != count:
            old, new = np.concatenate([[0.0], np.cumsum(phase)]), np.linspace(0.0, 1.0, count + 1)
            sums = np.hstack([np.zeros((len(u), 1)), np.cumsum(u * np.asarray(phase), axis=1)])
            x = np.array([np.interp(new, old, row) for row in x], dtype=np.float64)
            u = np.diff(np.array([np.interp(new, old, row) for row in sums], dtype=np.float64), axis=1) * count
        fractions.append(phase if len(phase) == count else uniform(count))
        state.append(x[:, :-1])
        control.append(u)
    state.append(iterate.state[:, -1:])
    return fractions, Iterate(iterate.durations, np.hstack(state), np.hstack(control))


def move_nodes(
    mesh: Sequence[Fractions],
    iterate: Iterate,
    nodes: Marks,
    targets: Sequence[Sequence[float]],
    *,
    beside_ends: bool = False,
) -> tuple[Mesh, Iterate]:
    """Move the nearest of some nodes to each of the target places; those between them move along.

    Nodes at the ends of phases stay, and none comes so near to the next one that it would nearly touch it.

    Args:
        mesh: fractions of every phase.
        iterate: on that mesh.
        nodes: which nodes may be moved, shape (N + 1,); those between phases are among them.
        targets: places in every phase, as shares of its duration.
        beside_ends: whether a place next to the end of a phase takes the node beside that; else it takes the end.

    Returns:
        The new mesh, and the iterate on it: states straight between the old nodes, the same controls.
    """
    first_node = np.cumsum([0, *(len(phase) for phase in mesh)])
    moved, state = list(mesh), iterate.state.copy()
    for index, shares in enumerate(targets):
        first, last = first_node[index], first_node[index + 1]
        old = np.concatenate([[0.0], np.cumsum(mesh[index])])
        places = old[nodes[first : last + 1]]
        moved_places = places.copy()
        for share in shares:
            nearest = int(np.abs(places - share).argmin())
            if beside_ends and 0.0 < share < 1.0:
                nearest = min(max(nearest, 1), len(places) - 2)
            if 0 < nearest < len(places) - 1 and moved_places[nearest] == places[nearest]:
                around = moved_places[nearest - 1 : nearest + 2 : 2]
                apart = LEAST_SHARE * np.diff(places[nearest - 1 : nearest + 2])
                moved_places[nearest] = min(max(share, around[0] + apart[0]), around[1] - apart[1])
        if (moved_places != places).any():
            new: Array = np.interp(old, places, moved_places)
            moved[index] = tuple(np.diff(new).tolist())
            state[:, first : last + 1] = [np.interp(new, old, row) for row in iterate.state[:, first : last + 1]]
    return moved, Iterate(iterate.durations, state, iterate.control)


def inherited_nodes(parts: Indices) -> Marks:
    """Mark the nodes of a divided mesh that were nodes before; shape (parts.sum() + 1,)."""
    inherited = np.zeros(int(parts.sum()) + 1, dtype=np.bool_)
    inherited[np.concatenate([[0], np.cumsum(parts)])] = True
    return inherited


def widen(marked: Marks) -> Marks:
    """Mark the intervals beside marked ones as well: where one alone is made finer, what is wrong moves to the next."""
    wider = marked.copy()
    wider[1:] |= marked[:-1]
    wider[:-1] |= marked[1:]
    return wider


Extent = Literal["end", "node", "interval", "duration", "one node"]
"""Where a limit holds: where phases meet, at the nodes between these, over intervals, for a whole phase, at one node
alone."""


@dataclass(frozen=True, eq=False)
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


def transfer_multipliers(multipliers: Multipliers, source_layout: Layout, target_layout: Layout) -> Multipliers:
    """Return the multipliers for another problem with as many phases.

    Args:
        multipliers: of a solved problem.
        source_layout: its layout.
        target_layout: of the other problem. Limits that the solved problem does not have get zero.
    """
    source_values = np.concatenate([multipliers.constraints, multipliers.bounds])
    target_values = np.zeros(target_layout.constraints + target_layout.unknowns)
    source_limits = limits_of(source_layout)
    for (extent, name), target_limit in limits_of(target_layout).items():
        if source_limit := source_limits.get((extent, name)):
            density = source_values[source_limit.places] / source_limit.weights
            if extent == "one node":  # which may be another one
                same = len(target_limit.places) == len(source_limit.places)
                target_values[target_limit.places] = target_limit.weights * density if same else 0.0
            else:
                at = _same if extent in ("end", "duration") else _interpolate
                target_values[target_limit.places] = target_limit.weights * at(
                    target_limit.along, source_limit.along, density
                )
    return Multipliers(target_values[: target_layout.constraints], target_values[target_layout.constraints :])


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
    sources, source = _number([*(sample.name for sample in layout.output_samples), "path"])  # the path is the last: -1
    names, name = _number([limit.quantity.name for limit in rows.limits])
    number = (source[rows.source] * len(names) + name[rows.number]) * 2 + at_end[rows.node]
    order = np.argsort(number, kind="stable")  # rows are in the order of their nodes
    weight = stretch[rows.node] * rows.scale
    single_node_names: set[str] = set()
    for phase in layout.problem.phases:
        for constraint in phase.path_constraints:
            if constraint.at is not None:
                single_node_names.add(f"{phase.name}, {constraint.name}")
    for members in np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else ():
        which, end = divmod(int(number[members[0]]), 2)
        sampled = sources[which // len(names)]
        key = f"{sampled}: {names[which % len(names)]}"
        limit = LimitPlaces(layout.row_index[members], along[rows.node[members]], weight[members])
        if sampled in single_node_names:
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
        inside, known_inside = phases == phase, known_phases == phase
        result[inside] = np.interp(along[inside], known_along[known_inside], density[known_inside])
    return result
