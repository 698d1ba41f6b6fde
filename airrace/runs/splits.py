"""The gate splits of a flight as a table: when and how every gate was passed."""

import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, overload

from airrace.export.csv import export_splits_csv
from airrace.inputs.units import KNOT
from airrace.procedure.result import GateSplit
from airrace.runs.output import write_text
from airrace.views.tables import html_table, text_table

if TYPE_CHECKING:
    from pandas import DataFrame

HEADS = ("gate", "time s", "leg s", "speed kt", "height m", "load g", "bank deg", "climb deg")


@dataclass(frozen=True, repr=False)
class Splits(Sequence[GateSplit]):
    """The passings of a flight in their order; each is a `GateSplit` in SI units and radians.

    Examples:
        >>> run.splits[0].name, run.splits[-1].name
        ('0:entry', '1:exit')
        >>> abs(run.splits[-1].time - run.race_time) < 1e-9
        True

    Attributes:
        rows: one per passing.
    """

    rows: tuple[GateSplit, ...]

    @overload
    def __getitem__(self, index: int) -> GateSplit: ...

    @overload
    def __getitem__(self, index: slice) -> "Splits": ...

    def __getitem__(self, index: int | slice) -> "GateSplit | Splits":
        return Splits(self.rows[index]) if isinstance(index, slice) else self.rows[index]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[GateSplit]:
        return iter(self.rows)

    def to_dataframe(self) -> "DataFrame":
        """Return the table that `airrace export csv --splits` writes, one row per passing, as a data frame of pandas.

        Columns name their units; angles are in degrees, speeds in m/s and in knots.

        Raises:
            UsageError: pandas is not installed.
        """
        from airrace.export.flight_table import splits_frame

        return splits_frame(self.rows)

    def to_csv(self, path: str | Path | None = None) -> str:
        """Return the table that `airrace export csv --splits` writes, as comma-separated values.

        Args:
            path: a file to be written; None for none.

        Returns:
            The text.

        Raises:
            StorageError: the system refused.
        """
        stream = io.StringIO(newline="")
        export_splits_csv(self.rows, stream)
        if path is not None:
            write_text(Path(path), stream.getvalue())
        return stream.getvalue()

    def __repr__(self) -> str:
        return text_table(HEADS, self._cells())

    def to_html(self) -> str:
        """Return the table as HTML, as notebooks show it."""
        return html_table("gate splits", HEADS, self._cells())

    def _repr_html_(self) -> str:
        return self.to_html()

    def _cells(self) -> list[tuple[str, ...]]:
        befores = [self.rows[0].time if self.rows else 0.0, *(row.time for row in self.rows)]
        return [_cells(row, before) for row, before in zip(self.rows, befores, strict=False)]


def _cells(row: GateSplit, before: float) -> tuple[str, ...]:
    return (
        row.name,
        f"{row.time:.3f}",
        f"{row.time - before:.3f}",
        f"{row.V_K / KNOT:.1f}",
        f"{row.height:.1f}",
        f"{row.n_z:z.2f}",
        f"{math.degrees(row.bank):z.1f}",
        f"{math.degrees(row.climb):z.1f}",
    )
