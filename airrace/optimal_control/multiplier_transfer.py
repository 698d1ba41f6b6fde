"""The multipliers of limits, carried over from one mesh of a race to another, or to the same race with other numbers.

A limit that holds along a phase has a multiplier per node whose size goes with the stretch of time that the node stands
for; its density is carried over. Conditions at the nodes between phases are carried over as they are. Multipliers of
the dynamics are left at zero: a solver finds them from those of the limits.
"""

from collections.abc import Mapping, Sequence
from enum import Enum

import numpy as np

from airrace.optimal_control.constraint_rows import Indices
from airrace.optimal_control.layout import Layout
from airrace.optimal_control.refinement import Marks
from airrace.optimal_control.solvers.interface import Multipliers
from airrace.records import record
from airrace.trajectory import Array


class Kind(Enum):
    """The places at which a limit holds: where phases meet, between these, over intervals, or for a whole phase."""

    END = "end"
    NODE = "node"
    INTERVAL = "interval"
    DURATION = "duration"


@record
class Limit:
    """A limit on one quantity, in n places.

    Attributes:
        places: of its multipliers in those of (g, w), shape (n,).
        along: where, in phases flown so far, shape (n,), ascending.
        weights: from densities in SI to multipliers, shape (n,).
    """

    places: Indices
    along: Array
    weights: Array

    def density(self, multipliers: Array) -> Array:
        """Return the densities of multipliers of (g, w)."""
        return multipliers[self.places] / self.weights


Limits = Mapping[tuple[Kind, str], Limit]
"""All limits of a problem, by their kinds and names."""


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
    for (kind, name), limit in limits_of(here).items():
        if (kind, name) in before:
            source = before[kind, name]
            at = _same if kind in (Kind.END, Kind.DURATION) else _between
            wanted[limit.places] = limit.weights * at(limit.along, source.along, source.density(known))
    return Multipliers(wanted[: here.constraints], wanted[here.constraints :])


def limits_of(layout: Layout) -> Limits:
    """Return all limits of a problem."""
    return {**_row_limits(layout), **_state_limits(layout), **_control_limits(layout), **_duration_limits(layout)}


def _row_limits(layout: Layout) -> Limits:
    """Return the limits that are constraints: path quantities and observations."""
    along, stretch, at_end = _along(layout), _stretch(layout), _at_end(layout)
    rows = layout.rows
    sources, source = _numbered(
        [*(one.name for one in layout.output_samples), "path"]
    )  # the path is the last, source -1
    names, name = _numbered([one.quantity.name for one in rows.limits])
    number = (source[rows.source] * len(names) + name[rows.number]) * 2 + at_end[rows.node]
    order = np.argsort(number, kind="stable")  # rows are in the order of their nodes
    weight = stretch[rows.node] * rows.scale
    found: dict[tuple[Kind, str], Limit] = {}
    for members in np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(order) else ():
        which, end = divmod(int(number[members[0]]), 2)
        told = f"{sources[which // len(names)]}: {names[which % len(names)]}"
        places = Limit(layout.row_index[members], along[rows.node[members]], weight[members])
        found[Kind.END if end else Kind.NODE, told] = places
    return found


def _numbered(names: Sequence[str]) -> tuple[list[str], Indices]:
    """Return the different names, and the number of each one among them."""
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    return list(numbers), np.array([numbers[name] for name in names], dtype=np.int64)


def _state_limits(layout: Layout) -> Limits:
    along, stretch, at_end = _along(layout), _stretch(layout), _at_end(layout)
    return {
        (kind, f"state: {quantity.name}"): Limit(
            layout.constraints + layout.state_index[nodes, component],
            along[nodes],
            stretch[nodes] * quantity.scale,
        )
        for component, quantity in enumerate(layout.problem.system.states)
        for kind, nodes in ((Kind.END, at_end), (Kind.NODE, ~at_end))
    }


def _control_limits(layout: Layout) -> Limits:
    nodes = _along(layout)
    ends = nodes[:-1] + layout.fractions  # the last interval of a phase ends where the next phase begins
    return {
        (Kind.INTERVAL, f"control: {quantity.name}"): Limit(
            layout.constraints + layout.control_index[:, component],
            (nodes[:-1] + ends) / 2.0,
            layout.fractions * quantity.scale,
        )
        for component, quantity in enumerate(layout.problem.system.controls)
    }


def _duration_limits(layout: Layout) -> Limits:
    places = layout.constraints + layout.phase_durations
    return {(Kind.DURATION, "duration"): Limit(places, np.arange(float(len(places))), np.ones(len(places)))}


def _along(layout: Layout) -> Array:
    """Return where each node is, in phases flown so far, shape (N + 1,); exact where phases meet."""
    passed = np.concatenate([[0.0], np.cumsum(layout.fractions)])
    passed[layout.first_node] = np.arange(len(layout.first_node))
    return passed


def _at_end(layout: Layout) -> Marks:
    """Return whether each node is the start, the end, or one at which phases meet; shape (N + 1,)."""
    marked = np.zeros(layout.intervals + 1, dtype=np.bool_)
    marked[layout.first_node] = True
    return marked


def _stretch(layout: Layout) -> Array:
    """Return the part of a phase that each node stands for, shape (N + 1,); 1 where phases meet."""
    halves = layout.fractions / 2.0
    stretch = np.append(halves, 0.0) + np.append(0.0, halves)
    stretch[layout.first_node] = 1.0
    return stretch


def _same(along: Array, known_along: Array, density: Array) -> Array:
    """Return the densities known at the very same places, zero at others."""
    at = np.maximum(np.searchsorted(known_along, along, side="right") - 1, 0)
    return np.where(known_along[at] == along, density[at], 0.0)


def _between(along: Array, known_along: Array, density: Array) -> Array:
    """Return densities straight between the known ones of the same phase; zero in a phase without any."""
    result = np.zeros(len(along))
    ends, known_ends = (_ends_of_phases(one) for one in (along, known_along))
    for phase, (first, last) in ends.items():
        if phase in known_ends:
            begin, end = known_ends[phase]
            result[first:last] = np.interp(along[first:last], known_along[begin:end], density[begin:end])
    return result


def _ends_of_phases(along: Array) -> dict[int, tuple[int, int]]:
    """Return the first place in each phase, and the one behind its last, of places in ascending order."""
    phases = np.floor(along).astype(np.int64)
    first = np.flatnonzero(np.diff(phases, prepend=-1)).tolist()
    return {int(phases[begin]): (begin, end) for begin, end in zip(first, [*first[1:], len(along)], strict=True)}
