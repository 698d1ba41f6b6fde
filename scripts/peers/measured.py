"""What a tool answers, and how exact that is: its controls integrated again by an integrator that is no tool's own."""

from dataclasses import dataclass

import numpy as np

from airrace.optimal_control.replay import integrate
from airrace.optimal_control.trajectory import Array
from peers.race import Race

TOLERANCE = 1e-12  # relative, and of a state's scale


@dataclass(frozen=True)
class Flight:
    """An optimum in a form common to all tools: phases of equal segments, with controls held over each.

    Attributes:
        durations: of the phases, s; (phases,).
        starts, ends: states at the ends of the phases; (12, phases).
        controls: (4, phases, segments).
    """

    durations: Array
    starts: Array
    ends: Array
    controls: Array

    @property
    def race_time(self) -> float:
        """Seconds from start to finish."""
        return float(self.durations.sum())


@dataclass(frozen=True)
class Answer:
    """A tool's flight, and what it took.

    Attributes:
        flight: None where the tool did not converge.
        status: the tool's own words.
        iterations: of its solver.
        setup, solve: wall seconds: putting the problem together, solving it.
        processor: processor seconds of both together.
        processor_solve: of solving alone.
    """

    flight: Flight | None
    status: str
    iterations: int
    setup: float
    solve: float
    processor: float
    processor_solve: float


def position_error(race: Race, flight: Flight) -> float:
    """How far a phase ends from where the tool believes, m: the largest of all phases, each flown from its start."""
    scale = np.array([one.scale for one in race.model.system.states])[:, None]
    phases, segments = flight.controls.shape[1:]
    steps, x = flight.durations / segments, flight.starts / scale
    for segment in range(segments):
        u = flight.controls[:, :, segment]

        def across(_: float, flat: Array, u: Array = u) -> Array:
            x = flat.reshape(len(scale), phases) * scale
            return (np.array(race.rates(list(x), list(u))) * steps / scale).ravel()

        flown = integrate(across, x.ravel(), np.array([0.0, 1.0]), relative=TOLERANCE, absolute=TOLERANCE)
        x = flown[:, -1].reshape(len(scale), phases)
    return float(np.linalg.norm((x * scale - flight.ends)[:3], axis=0).max())
