"""The optimum as a reference line: states and stick over its own clock, and how far a state is off it.

An aircraft is compared with the place of the line that it is abeam of, not with the place where the optimum is at the
same time: the clock of a flight is that at which its position lies in the plane across the line. Errors are

    e = (R^T (r - r*), V - V*, 2 vec(q*^-1 o q), the other states - theirs)

in the axes `R` of the flight path on the line, sixteen numbers; the first, along the line, is zero on the clock.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.errors import UsageError
from airrace.flights.safety.plant import CONTROLS, DISTURBANCES, STATE, STATES, DisturbedPlant, advance
from airrace.model.frames import QUATERNION, product, rotation
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.procedure import stored_stages
from airrace.procedure.result import StageResult
from airrace.race import Race

ERRORS = (
    *("along", "right", "down", "speed", "roll", "pitch", "yaw", "delta_T"),
    *("alpha_K", "beta_K", "p_K", "q_K", "r_K", "eta", "xi", "zeta"),
)
"""The names of the errors, in order; SI and radians."""
PATH = 7
"""The number of the first errors that are those of the path: position, speed and attitude."""
TABLE_STEP = 0.005
"""The step of the table, s: between its entries a line is at most 0.3 mm off one that turns at 10 g."""
RUN_OUT = 0.4
"""The time for which the line goes on behind the finish, s, with the stick held: 40 m, so that wide flights cross."""


@dataclass(frozen=True, eq=False)
class NominalFlight:
    """An optimum over its clock, at even steps; or as many lines as there are flights, one for each.

    Attributes:
        state: at the steps, shape (M, 17), or (n, M, 17) of n lines.
        moved: integrals of the controls up to the steps, shape (M, 4), or (n, M, 4).
        passing_times: when the passages are passed, s; shape (n,).
    """

    state: Array
    moved: Array
    passing_times: Array

    @classmethod
    def from_optimum(cls, race: Race, result: StageResult, plant: DisturbedPlant) -> "NominalFlight":
        """Return the optimum of the stage with six degrees of freedom.

        Raises:
            UsageError: the stage has other states, or its histories are those of no flight.
        """
        trajectory = result.trajectory
        names = [state.name for state in plant.system.states]
        if not set(names) <= {state.name for state in trajectory.states}:
            raise UsageError(f"closed-loop flights follow an optimum of six-dof; {result.stage.value} is another stage")
        line = cls.along(trajectory, stored_stages.sampler(race, result), plant)
        if not np.isfinite(line.state).all():
            raise UsageError(f"{result.stage.value} is no flight that could be followed: it cannot be integrated again")
        return line

    @classmethod
    def along(
        cls,
        trajectory: Trajectory,
        sampler: Callable[[Array], Mapping[str, Array]],
        plant: DisturbedPlant,
        until: float = math.inf,
    ) -> "NominalFlight":
        """Return a flight as a line, not finite where it cannot be integrated again.

        Args:
            trajectory: of the model of the plant.
            sampler: its states at any times, s, by name.
            plant: the aircraft.
            until: the time up to which the line is needed, s; behind the end it goes on with the stick held.
        """
        count = int(np.floor(min(trajectory.time[-1], until) / TABLE_STEP)) + 1
        times = instants(TABLE_STEP, count)
        histories = sampler(times)
        state = np.stack([histories[name] for name in STATE])
        controls = np.stack([trajectory[control.name] for control in plant.system.controls])
        sums = np.pad(np.cumsum(controls * np.diff(trajectory.time), axis=1), ((0, 0), (1, 0)))
        moved = np.stack([np.asarray(np.interp(times, trajectory.time, row), np.float64) for row in sums])
        inputs = np.zeros((CONTROLS + DISTURBANCES, 1))
        inputs[CONTROLS - 1] = controls[-1, -1]
        rates, behind, x = plant.rates_of(inputs), list[Array](), state[:, -1:]
        for _ in range(round(RUN_OUT / TABLE_STEP) if until > trajectory.time[-1] else 0):
            x = advance(rates, x, TABLE_STEP)
            behind.append(x)
        last = moved[:, -1:] + inputs[:CONTROLS] * TABLE_STEP * np.arange(1, len(behind) + 1)
        first = trajectory.first_node.tolist()
        states, sums = np.hstack([state, *behind]).T, np.hstack([moved, last]).T
        return cls(np.ascontiguousarray(states), np.ascontiguousarray(sums), trajectory.time[first])

    @property
    def end(self) -> float:
        """The clock at the end of the table, s."""
        return TABLE_STEP * (self.state.shape[-2] - 1)

    def at(self, clock: Array, rows: slice = slice(STATES)) -> Array:
        """Return states at clocks (n,), s, within the table; shape (17, n), or some of their rows."""
        return _between(self.state[..., rows], clock)

    def stick(self, clock: Array, seconds: float, rows: slice = slice(CONTROLS)) -> Array:
        """Return the mean controls from each clock on for some seconds, shape (4, n), or some of their rows."""
        begin = np.minimum(np.maximum(clock, 0.0), self.end - seconds)
        return (self.moved_to(begin + seconds, rows) - self.moved_to(begin, rows)) / seconds

    def moved_to(self, clock: Array, rows: slice = slice(CONTROLS)) -> Array:
        """Return the integrals of the controls up to clocks (n,), shape (4, n), or some of their rows."""
        return _between(self.moved[..., rows], clock)


def instants(step: float, count: int) -> Array:
    """Return 0, step, 2 step, ..., so many; s."""
    return np.asarray(step * np.arange(count), np.float64)


def entries(table: Array, row: NDArray[np.int64], dimensions: int) -> Array:
    """Return the entries (arrays of some dimensions) at rows (n,) of a table: one for all flights, or one for each."""
    return table[row] if table.ndim == 1 + dimensions else table[np.arange(len(table)), row]


def _between(table: Array, clock: Array) -> Array:
    place = np.minimum(np.maximum(clock / TABLE_STEP, 0.0), table.shape[-2] - 1.001)
    row = place.astype(np.int64)
    share, first = (place - row)[:, None], entries(table, row, 1)
    return np.ascontiguousarray((first + share * (entries(table, row + 1, 1) - first)).T)


def errors(state: Array, line: Array) -> Array:
    """Return the errors (16, n) of states against those on the line, both (17, n)."""
    R = rotation(list(line[4:8]))
    offset = state[:3] - line[:3]
    a, b, c, d = line[4:8]
    turned = product((a, -b, -c, -d), list(state[4:8]))
    side = np.where(turned[0] < 0.0, -2.0, 2.0)
    position = [R[0][i] * offset[0] + R[1][i] * offset[1] + R[2][i] * offset[2] for i in range(3)]
    return np.stack(
        [*position, state[3] - line[3], *(side * component for component in turned[1:]), *(state[8:] - line[8:])]
    )


def displace(line: Array, error: Array) -> Array:
    """Return the states (17, n) that have errors (16, n) against those on the line, the inverse of `errors`."""
    R = rotation(list(line[4:8]))
    position = [line[i] + R[i][0] * error[0] + R[i][1] * error[1] + R[i][2] * error[2] for i in range(3)]
    half = 0.5 * error[4:7]
    turn = [np.sqrt(1.0 - np.sum(half * half, axis=0)), *half]
    return np.stack([*position, line[3] + error[3], *product(list(line[4:8]), turn), *(line[8:] + error[7:])])


def gradients(values: Callable[[Array, Array], Array], line: Array) -> Array:
    """Return the derivatives of some values by the errors and the disturbances, by central differences.

    Args:
        values: of states (17, m) and disturbances (6, m), shape (k, m).
        line: the states where there is neither, shape (17, n), attitudes of unit length.

    Returns:
        Shape (k, n, 16 + 6).
    """
    width, size = 1e-5, len(ERRORS)
    derivatives: list[Array] = []
    for place in range(size + DISTURBANCES):
        ends: list[Array] = []
        for side in (width, -width):
            displacement = np.zeros((size + DISTURBANCES, line.shape[1]))
            displacement[place] = side
            ends.append(values(displace(line, displacement[:size]), displacement[size:]))
        derivatives.append((ends[0] - ends[1]) / (2.0 * width))
    return np.stack(derivatives, axis=2)


def abeam(nominal: NominalFlight, state: Array, clock: Array) -> Array:
    """Return the clocks (n,) at which states (17, n) are abeam of the line, near clocks that they are known to be near.

    One Newton step leaves 0.1 mm where the clock before was right within 1 ms.
    """
    line = nominal.at(clock, slice(8))
    R = rotation(list(line[4:8]))
    along = sum(R[i][0] * (state[i] - line[i]) for i in range(3))
    return np.asarray(np.minimum(np.maximum(clock + along / line[3], 0.0), nominal.end), np.float64)


assert tuple(STATE)[4:8] == QUATERNION  # which the errors count on
