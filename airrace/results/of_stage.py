"""The flight of a finished stage of a run."""

import numpy as np

from airrace.planning.race import Race
from airrace.procedure import results_api
from airrace.procedure.result import StageResult
from airrace.results.derivation import completed
from airrace.results.flight import Crossing, Flight, Source
from airrace.results.history import Basis, History

LONGEST_STEP = 0.02
"""The longest time between two samples, s.

At 10 g a straight line cuts a corner by `a t^2 / 8`, which is 5 mm; at 6 rad/s the attitude turns by 7 degrees.
"""


def flight_of(race: Race, result: StageResult, source: Source, *, longest_step: float = LONGEST_STEP) -> Flight:
    """Return the optimum of a stage as a flight; its time axis holds the nodes of the mesh, and so all crossings.

    Args:
        race: course, aircraft and air.
        result: a stage that found a flight.
        source: what it is called.
        longest_step: between two times, s.
    """
    read = results_api.continuous(race, result, longest_step)
    given = {one.name: History(one, values, Basis.SOLVED) for one, values in read.solved.items()}
    given |= {one.name: History(one, values, Basis.DERIVED) for one, values in read.derived.items()}
    histories = completed(race, given)
    crossings: list[Crossing] = []
    nodes = result.trajectory.first_node.tolist()
    for passage, node in zip(race.course.passages, nodes, strict=True):
        time = float(result.trajectory.time[node])
        row = int(np.searchsorted(read.time, time))
        crossings.append(Crossing(passage, time, {name: float(one.values[row]) for name, one in histories.items()}))
    return Flight(race, source, read.time, histories, tuple(crossings))
