"""Flights as tables: samples of a trajectory, columns with their units, data frames."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airrace.errors import UsageError
from airrace.flights.results.attitude import euler_angles, interpolate_attitude, path_axes
from airrace.model.frames import QUATERNION
from airrace.optimal_control.quantities import DEGREE, KNOT, Quantity
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.runtime.resources import extra

if TYPE_CHECKING:
    from pandas import DataFrame

Sampler = Callable[[Array], Mapping[str, Array]]
"""Returns histories at times (s, shape (n,)), at least of all states, e.g. by integration between nodes."""
Derived = Mapping[Quantity, Callable[[Mapping[str, Array]], Array]]
"""Further columns: a declaration, and its values from the sampled states and controls, in the declared unit."""
NO_DERIVED: Derived = MappingProxyType({})

ROWS_MAX = 10_000_000
"""The largest number of rows that are sampled at a fixed rate."""
ROWS_AT_ONCE = 10_000
"""The largest number of rows of a piece of a table."""
SPEEDS = ("V_K", "V_A", "V_I")
PATH_ANGLES = ("chi", "gamma", "mu")


@dataclass(frozen=True, eq=False)
class Samples:
    """The histories of a flight at the times of the rows.

    Attributes:
        time: s; shape (n,).
        histories: every state and control by name; each of shape (n,).
        phase: index of the phase each row lies in; a gate belongs to the phase it begins. Shape (n,).
    """

    time: Array
    histories: Mapping[str, Array]
    phase: NDArray[np.int64]


def at_nodes(trajectory: Trajectory) -> Samples:
    """Return the samples of a flight, one row per node; the last node repeats the controls of the last interval."""
    intervals = np.minimum(np.arange(len(trajectory.time)), trajectory.control.shape[1] - 1)
    return _samples(trajectory, trajectory.time, intervals, _histories(trajectory.states, trajectory.state))


def at_times(trajectory: Trajectory, time: Array, sampler: Sampler | None = None) -> Samples:
    """Return rows at some times of a flight, s.

    Controls are those of the interval the time lies in. States come from the sampler; without one they are interpolated
    linearly between the nodes (which cuts corners by up to `a dt^2 / 8`, e.g. 0.35 m at 10 g and intervals of 0.17 s),
    quaternions along the shorter way and renormalised.
    """
    intervals = np.searchsorted(trajectory.time, time, side="right") - 1
    intervals = np.clip(intervals, 0, trajectory.control.shape[1] - 1)
    if sampler is not None:
        return _samples(trajectory, time, intervals, sampler(time))
    nodes = _histories(trajectory.states, trajectory.state)
    states = {name: np.interp(time, trajectory.time, values) for name, values in nodes.items()}
    if all(name in nodes for name in QUATERNION):
        q = interpolate_attitude(trajectory.time, np.array([nodes[name] for name in QUATERNION]), time)
        states.update(zip(QUATERNION, q, strict=True))
    return _samples(trajectory, time, intervals, states)


def _histories(quantities: tuple[Quantity, ...], values: Array) -> dict[str, Array]:
    return {quantity.name: row for quantity, row in zip(quantities, values, strict=True)}


def _samples(trajectory: Trajectory, time: Array, intervals: NDArray[np.int64], states: Mapping[str, Array]) -> Samples:
    controls = _histories(trajectory.controls, trajectory.control[:, intervals])
    phase = np.searchsorted(trajectory.first_node[1:-1], intervals, side="right")
    return Samples(time, {**controls, **states}, phase)


def times_at_rate(trajectory: Trajectory, rate: float) -> Array:
    """Return the times of rows at a fixed rate (Hz) from the start, and the very end, s.

    Raises:
        UsageError: the rate is not positive or gives more than ten million rows, or the flight has no finite duration.
    """
    start, end = float(trajectory.time[0]), float(trajectory.time[-1])
    if not np.all(np.isfinite(trajectory.time)):
        raise UsageError("this flight has no finite duration: it can only be exported on its mesh")
    if not 0.0 < rate < float("inf") or (end - start) * rate > ROWS_MAX:
        raise UsageError(
            f"a rate of {rate:g} Hz cannot be exported: it must be positive and give at most {ROWS_MAX} rows"
        )
    # A last step shorter than a millionth of a step is the end itself, met up to rounding.
    steps = int(np.ceil((end - start) * rate - 1e-6))
    return np.append(start + np.arange(steps) / rate, end)


@dataclass(frozen=True, eq=False)
class HistoryColumn:
    """A column: its header and its values, shape (n,)."""

    header: str
    values: Array


def display_columns(quantity: Quantity, values: Array) -> Iterator[HistoryColumn]:
    """Yield the columns of a quantity in units for people: angles in degrees; speeds in m/s and in knots."""
    unit = quantity.unit
    if unit == "rad" or unit.startswith("rad/"):
        unit, values = unit.replace("rad", "deg", 1), values / DEGREE
    suffix = unit_suffix(unit)
    yield HistoryColumn(f"{quantity.name}_{suffix}" if suffix else quantity.name, values)
    if quantity.name in SPEEDS:
        yield HistoryColumn(f"{quantity.name}_kt", values / KNOT)


def unit_suffix(unit: str) -> str:
    """Return a unit in letters, digits and underscores: `m/s^2` is `m_s2`, `1/s` is `per_s`, no unit is nothing."""
    if unit in ("", "1", "-"):
        return ""
    if unit.startswith("1/"):
        unit = "per_" + unit[2:]
    for symbol, letters in (("%", "percent"), ("^", ""), ("²", "2"), ("³", "3"), ("°", "deg")):
        unit = unit.replace(symbol, letters)
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in unit)


@dataclass(frozen=True)
class FlightTable:
    """A flight as a table of n rows, at the times of `samples`.

    Attributes:
        samples: named histories in SI units and radians.
        quantities: declarations of the histories.
        columns: the histories in units for people, with what follows from them; each of shape (n,).
        phases: the name of the leg that each row belongs to.
    """

    samples: Samples
    quantities: tuple[Quantity, ...]
    columns: tuple[HistoryColumn, ...]
    phases: tuple[str, ...]


def flight_table(
    trajectory: Trajectory,
    *,
    rate_hz: float | None = None,
    derived: Derived = NO_DERIVED,
    sampler: Sampler | None = None,
) -> FlightTable:
    """Return a flight as a table, on the nodes of its mesh or at a fixed rate.

    Args:
        trajectory: the flight.
        rate_hz: rows per second from the start to the end, both included; None for one row per node of the mesh.
        derived: further columns.
        sampler: gives the states between the nodes; without one they are interpolated linearly, see `at_times`.

    Raises:
        UsageError: the rate cannot be exported.
    """
    if rate_hz is None:
        return _table(trajectory, at_nodes(trajectory), derived)
    return _table(trajectory, at_times(trajectory, times_at_rate(trajectory, rate_hz), sampler), derived)


def flight_tables(
    trajectory: Trajectory, rate_hz: float | None, derived: Derived, sampler: Sampler | None
) -> Iterator[FlightTable]:
    """Return the same table in pieces of `ROWS_AT_ONCE` rows, of which only one needs memory; see `flight_table`."""
    if rate_hz is None:
        return iter([_table(trajectory, at_nodes(trajectory), derived)])
    times = times_at_rate(trajectory, rate_hz)
    return (_table(trajectory, at_times(trajectory, piece, sampler), derived) for piece in pieces(times))


def pieces(times: Array) -> Iterator[Array]:
    """Yield times in pieces of `ROWS_AT_ONCE`."""
    for first in range(0, len(times), ROWS_AT_ONCE):
        yield times[first : first + ROWS_AT_ONCE]


def _table(trajectory: Trajectory, samples: Samples, derived: Derived) -> FlightTable:
    """Return time, states, controls, what follows from position and attitude, and derived columns, in this order."""
    histories, quantities = samples.histories, (*trajectory.states, *trajectory.controls)
    columns = [HistoryColumn("time_s", samples.time)]
    for quantity in quantities:
        columns.extend(display_columns(quantity, histories[quantity.name]))
    if "z" in histories:
        columns.append(HistoryColumn("height_m", -histories["z"]))
    if all(name in histories for name in QUATERNION):
        angles = euler_angles(path_axes([histories[name] for name in QUATERNION]))
        for name, angle in zip(PATH_ANGLES, angles, strict=True):
            columns.append(HistoryColumn(f"{name}_deg", angle / DEGREE))
    for quantity, function in derived.items():
        columns.extend(display_columns(quantity, function(histories)))
    phases = tuple(np.array(trajectory.phases)[samples.phase].tolist())
    return FlightTable(samples, quantities, tuple(columns), phases)


def flight_frame(flight: FlightTable) -> "DataFrame":
    """Return a data frame of the flight, with one row per time.

    `time_s` is the index, and the leg of each row is the category `phase`.

    Raises:
        UsageError: pandas is not installed.
    """
    pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
    time, *columns = flight.columns
    index = pandas.Index(time.values, name=time.header)
    frame = pandas.DataFrame({column.header: column.values for column in columns}, index=index)
    frame["phase"] = pandas.Categorical(flight.phases, categories=list(dict.fromkeys(flight.phases)))
    return frame
