"""The briefing of a flight: its cues, what the pilot does leg by leg, as tables of every kind."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, overload

from airrace.results import Flight
from airrace.results.cues import Cue, cues_of
from airrace.runs.json_objects import flight_object
from airrace.runs.output import write_text
from airrace.views.stage_tables import NOTE, action_table, cue_table, cue_text, place_text
from airrace.views.tables import RACE, Table, Units

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class Brief(Sequence[Cue]):
    """The cues of a flight in the order in which they begin; each is a `Cue` in SI units and radians.

    Examples:
        >>> brief = run.brief()
        >>> brief[0].leg.name
        '1:vertical'

    Attributes:
        flight: whose cues they are.
        cues: in order.
    """

    flight: Flight
    cues: tuple[Cue, ...]

    @classmethod
    def of(cls, flight: Flight) -> "Brief":
        """Return the briefing of a flight; empty where that knows neither load factor nor attitude."""
        return cls(flight, cues_of(flight))

    @overload
    def __getitem__(self, index: int) -> Cue: ...

    @overload
    def __getitem__(self, index: slice) -> "Brief": ...

    def __getitem__(self, index: int | slice) -> "Cue | Brief":
        return Brief(self.flight, self.cues[index]) if isinstance(index, slice) else self.cues[index]

    def __len__(self) -> int:
        return len(self.cues)

    def __iter__(self) -> Iterator[Cue]:
        return iter(self.cues)

    @property
    def lines(self) -> list[str]:
        """One line per cue, e.g. `6.68 s, 52 m before c1: roll right 6° -> 88°, 0.4 s`."""
        return [f"{', '.join(filter(None, (f'{one.time:.2f} s', place_text(one))))}: {cue_text(one)}" for one in self]

    def table(self, units: Units = RACE, *, unicode: bool = True) -> Table:
        """Return the table that `airrace brief` prints, in ASCII where `unicode` is False."""
        title = f"{self.flight.label}: what the pilot does, leg by leg"
        return cue_table(self.cues, title, units=units, notes=[NOTE], unicode=unicode)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace brief --json` prints: one entry of `actions` per row of the CSV."""
        return {**flight_object(self.flight), "actions": action_table(self.cues).objects()}

    def to_dataframe(self) -> "DataFrame":
        """Return the table that `airrace brief --csv` prints, one row per action, as a data frame of pandas.

        Raises:
            UsageError: pandas is not installed.
        """
        return action_table(self.cues).dataframe("time_s")

    def to_csv(self, path: str | Path | None = None) -> str:
        """Return the table that `airrace brief --csv` prints, as comma-separated values.

        Args:
            path: a file to be written; None for none.

        Raises:
            StorageError: the system refused.
        """
        text = action_table(self.cues).csv(".10g")
        if path is not None:
            write_text(Path(path), text)
        return text

    def __repr__(self) -> str:
        return self.table().text()

    def _repr_html_(self) -> str:
        return self.table().html()
