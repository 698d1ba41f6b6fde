"""The gate splits of a flight as a table: when and how every gate was passed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, overload

from airrace.procedure.result import GateSplit
from airrace.runs.output import write_text
from airrace.views.stage_tables import splits_table

if TYPE_CHECKING:
    from pandas import DataFrame


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
        return splits_table(self.rows).dataframe("passage")

    def to_csv(self, path: str | Path | None = None) -> str:
        """Return the table that `airrace export csv --splits` writes, as comma-separated values.

        Args:
            path: a file to be written; None for none.

        Returns:
            The text.

        Raises:
            StorageError: the system refused.
        """
        text = splits_table(self.rows).csv(".10g")
        if path is not None:
            write_text(Path(path), text)
        return text

    def __repr__(self) -> str:
        return splits_table(self.rows).text()

    def to_html(self) -> str:
        """Return the table as HTML, as notebooks show it."""
        return splits_table(self.rows).html()

    def _repr_html_(self) -> str:
        return self.to_html()
