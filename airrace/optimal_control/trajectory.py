"""Trajectories: named time histories of a flight through several phases, and the arrays of numbers (numpy only)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.quantities import Quantity

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The histories of a flight's states and controls on the nodes of a mesh.

    Phase `i` owns the nodes `first_node[i] ... first_node[i + 1]`, both ends included: neighbours share one node.

    Attributes:
        phases: names of the phases, n.
        first_node: node at which each phase begins and, last, the final node; shape (n + 1,), integers.
        durations: duration of each phase, s; shape (n,).
        time: time at the nodes, s from the start; shape (N + 1,).
        states: declarations of the rows of `state`.
        state: values at the nodes; shape (n_x, N + 1).
        controls: declarations of the rows of `control`.
        control: values on the intervals (constant over each); shape (n_u, N).
    """

    phases: tuple[str, ...]
    first_node: Indices
    durations: Array
    time: Array
    states: tuple[Quantity, ...]
    state: Array
    controls: tuple[Quantity, ...]
    control: Array

    @property
    def race_time(self) -> float:
        """The time from the first to the last node, s."""
        return float(self.durations.sum())

    def __getitem__(self, name: str) -> Array:
        """Return the history of one state (on the nodes) or control (on the intervals) by its name.

        Raises:
            KeyError: no state and no control has this name.
        """
        for declared, values in ((self.states, self.state), (self.controls, self.control)):
            for row, quantity in enumerate(declared):
                if quantity.name == name:
                    return values[row]
        raise KeyError(name)

    def __repr__(self) -> str:
        names = ", ".join(quantity.name for quantity in (*self.states, *self.controls))
        return f"<Trajectory of {self.race_time:.3f} s: {len(self.phases)} phases, {len(self.time)} nodes, {names}>"

    def named(self) -> Mapping[str, Array]:
        """Return the histories of all states and controls by name."""
        names = [quantity.name for quantity in (*self.states, *self.controls)]
        return {name: self[name] for name in names}
