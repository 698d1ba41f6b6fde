"""The least distances of a flight from everything on the course, as a table."""

from collections.abc import Sequence

from airrace.results import Flight
from airrace.results.clearances import least_distances
from airrace.views.tables import Column, Table

_DISTANCES = (
    Column("from", wraps=True),
    Column("least", "m", "z.2f"),
    Column("required", "m", "z.1f"),
    Column("left", "m", "z.2f"),
    Column("at", "s", "z.2f"),
    Column("height", "m", "z.0f"),
)


def distance_table(flight: Flight, title: str, *, begin: float = 0.0, notes: Sequence[str] = ()) -> Table:
    """Return a row for every thing; none where nothing is known.

    Args:
        flight: of which it is.
        title: stands above it.
        begin: the time that times count from, s.
        notes: sentences that belong to it.
    """
    rows = [
        (one.text, one.distance, one.required, one.margin, one.time - begin, one.height)
        for one in least_distances(flight)
    ]
    return Table(title, _DISTANCES, rows, notes)
