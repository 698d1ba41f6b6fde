"""The linear program that proposes prices: those with the highest bound, as far as the known flights of windows tell.

Every known flight is a cutting plane: no least priced time of its window can be above its own, whatever the prices.
"""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from airrace.optimal_control.trajectory import Array
from airrace.procedure.multistart.priced_window import Window, WindowFlight


@dataclass(frozen=True, eq=False)
class Proposal:
    """Prices that a linear program proposes.

    Attributes:
        weights: by passage, of the gates between windows, (n_f,), s.
        promised: the bound at these weights if no window had other flights than those known, s.
        shares: of the known flights of each window in the optimum (1); they add up to 1. No weight at its limit, they
            are the flight of the relaxed race.
    """

    weights: dict[int, Array]
    promised: float
    shares: dict[Window, Array]


def propose_weights(
    flights: Mapping[Window, Sequence[WindowFlight]], weights: Mapping[int, Array], radius: float
) -> Proposal | None:
    """Return the weights within a radius that have the highest bound; None if the solver finds none.

    Unknown are the weights at every gate between windows, and the least priced time t of every window:
    t <= duration + weights . features at its end - weights . features at its start, for each flight of it.

    Args:
        flights: the known flights of windows that make up the race, in order.
        weights: of now, by passage, (n_f,), s.
        radius: how far each weight may move, s.
    """
    gates = [first for first, _ in flights][1:]
    centre = np.concatenate([weights[gate] for gate in gates]) if gates else np.zeros(0)
    columns = {
        gate: slice(number * len(weights[gate]), (number + 1) * len(weights[gate])) for number, gate in enumerate(gates)
    }
    rows: list[Array] = []
    seconds: list[float] = []
    for number, ((first, last), known) in enumerate(flights.items()):
        for flight in known:
            row = np.zeros(len(centre) + len(flights))
            row[len(centre) + number] = 1.0
            if first in columns:
                row[columns[first]] += flight.at_start
            if last in columns:
                row[columns[last]] -= flight.at_end
            rows.append(row)
            seconds.append(flight.seconds)
    cost = np.concatenate([np.zeros(len(centre)), -np.ones(len(flights))])
    box = [*((weight - radius, weight + radius) for weight in centre), *[(None, None)] * len(flights)]
    linprog: Any = importlib.import_module("scipy.optimize").linprog  # Any: untyped in scipy, which takes 0.3 s to load
    solution: Any = linprog(cost, np.array(rows), np.array(seconds), bounds=box, method="highs")
    if not solution.success:
        return None
    ends = np.cumsum([len(known) for known in flights.values()])[:-1]
    shares = np.split(-np.array(solution.ineqlin.marginals), ends)
    proposed = {gate: np.array(solution.x[columns[gate]]) for gate in gates}
    return Proposal(proposed, -float(solution.fun), dict(zip(flights, shares, strict=True)))
