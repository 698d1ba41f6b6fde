"""A flight as columns over time, ready to be written in any format."""

from collections.abc import Iterator, Sequence
from types import MappingProxyType

import numpy as np

from airrace.export.columns import DEGREE, Column, Derived, columns_of
from airrace.export.sampling import Sampler, Samples, at_nodes, at_rate, at_times, times_at_rate
from airrace.procedure.result import GateSplit
from airrace.quantities import KNOT, Quantity
from airrace.records import record
from airrace.trajectory import Array, Trajectory

NO_DERIVED: Derived = MappingProxyType({})
ROWS_AT_ONCE = 10_000
"""The largest number of rows of a piece of a table."""


@record
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
    columns: tuple[Column, ...]
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
        sampler: gives the states between the nodes; without one they are interpolated linearly, see `sampling`.

    Raises:
        UsageError: the rate cannot be exported.
    """
    return _table(
        trajectory, at_nodes(trajectory) if rate_hz is None else at_rate(trajectory, rate_hz, sampler), derived
    )


def flight_tables(
    trajectory: Trajectory,
    *,
    rate_hz: float | None = None,
    derived: Derived = NO_DERIVED,
    sampler: Sampler | None = None,
) -> Iterator[FlightTable]:
    """Return the same table in pieces of `ROWS_AT_ONCE` rows, of which only one needs memory; see `flight_table`."""
    if rate_hz is None:
        return iter([_table(trajectory, at_nodes(trajectory), derived)])
    times = times_at_rate(trajectory, rate_hz)
    return (_table(trajectory, at_times(trajectory, some, sampler), derived) for some in pieces(times))


def pieces(times: Array) -> Iterator[Array]:
    """Yield times in pieces of `ROWS_AT_ONCE`."""
    for first in range(0, len(times), ROWS_AT_ONCE):
        yield times[first : first + ROWS_AT_ONCE]


def _table(trajectory: Trajectory, samples: Samples, derived: Derived) -> FlightTable:
    columns = columns_of(trajectory, samples, derived)
    phases = tuple(np.array(trajectory.phases)[samples.phase].tolist())
    return FlightTable(samples, (*trajectory.states, *trajectory.controls), tuple(columns), phases)


def split_columns(splits: Sequence[GateSplit]) -> tuple[Column, ...]:
    """Return when every passing was, how long since the one before, and how it was flown; each of shape (n,).

    The first passing is the start, which is since itself.
    """
    time = np.array([split.time for split in splits], np.float64)
    speed = np.array([split.V_K for split in splits], np.float64)
    return (
        Column("time_s", time),
        Column("leg_s", np.diff(time, prepend=0.0)),
        Column("V_K_m_s", speed),
        Column("V_K_kt", speed / KNOT),
        Column("height_m", np.array([split.height for split in splits], np.float64)),
        Column("n_z", np.array([split.n_z for split in splits], np.float64)),
        Column("bank_deg", np.array([split.bank for split in splits], np.float64) / DEGREE),
        Column("climb_deg", np.array([split.climb for split in splits], np.float64) / DEGREE),
        Column("heading_deg", _compass(np.array([split.heading for split in splits], np.float64))),
    )


def _compass(heading: Array) -> Array:
    """Return headings in degrees from 0 up to, not including, 360, also after rounding."""
    return np.mod(np.round(heading / DEGREE, 7), 360.0)
