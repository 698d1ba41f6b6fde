"""What a stage or a log tells as sequences and mappings shown as tables: cues, gate splits, and sensitivities."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from airrace.errors import UsageError
from airrace.files.inputs import Inputs
from airrace.flights.results import Flight
from airrace.flights.results.cues import Cue, cues_of
from airrace.flights.sensitivity import LatenessPrice, Sensitivity
from airrace.model.parameters import ParameterGroup
from airrace.pages.report.sensitivity_tables import sensitivities_table
from airrace.pages.views.cue_tables import NOTE, cue_rows, cue_table, cue_text, place_text
from airrace.pages.views.stage_tables import splits_table
from airrace.pages.views.tables import RACE, Table, Units
from airrace.procedure.result import GateSplit, StageResult
from airrace.runs.json_objects import flight_object
from airrace.runs.output import write_text
from airrace.runtime.resources import extra

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
        prices: of lateness, one per cue; none where they were not asked for.
    """

    flight: Flight
    cues: tuple[Cue, ...]
    prices: tuple[LatenessPrice, ...] = ()

    @classmethod
    def of(cls, flight: Flight) -> "Brief":
        """Return the briefing of a flight; empty where that knows neither load factor nor attitude."""
        return cls(flight, cues_of(flight))

    def with_prices(self, inputs: Inputs, result: StageResult) -> "Brief":
        """Return the briefing with the prices of lateness, each solved from the stage whose flight it is.

        Raises:
            NotCertified: the stage is no optimum, certified or solved.
        """
        from airrace.flights.sensitivity.lateness import lateness_prices  # loads the solver

        times = [cue.time for cue in self.cues]
        return replace(self, prices=tuple(lateness_prices(times, inputs.race, inputs.settings, result)))

    @overload
    def __getitem__(self, index: int) -> Cue: ...

    @overload
    def __getitem__(self, index: slice) -> "Brief": ...

    def __getitem__(self, index: int | slice) -> "Cue | Brief":
        return (
            replace(self, cues=self.cues[index], prices=self.prices[index])
            if isinstance(index, slice)
            else self.cues[index]
        )

    def __len__(self) -> int:
        return len(self.cues)

    def __iter__(self) -> Iterator[Cue]:
        return iter(self.cues)

    @property
    def lines(self) -> list[str]:
        """One line per cue, e.g. `6.68 s, 52 m before c1: roll right R6 to R88 in 0.4 s; pull 5.1 g`."""
        return [f"{', '.join(filter(None, (f'{cue.time:.2f} s', place_text(cue))))}: {cue_text(cue)}" for cue in self]

    def table(self, units: Units = RACE, *, unicode: bool = True) -> Table:
        """Return the table that `airrace brief` prints, in ASCII where `unicode` is False."""
        title = f"{self.flight.label}: what the pilot does, leg by leg"
        notes = [self.flight.stamp.text, NOTE]
        return cue_table(self.cues, title, units=units, notes=notes, unicode=unicode, prices=self.prices)

    def as_object(self) -> dict[str, object]:
        """Return the object that `airrace brief --json` prints: one entry of `cues` per row of the CSV."""
        return {**flight_object(self.flight), "cues": cue_rows(self.cues, self.prices).objects()}

    def to_dataframe(self) -> "DataFrame":
        """Return the table that `airrace brief --csv` prints, one row per cue, as a data frame of pandas.

        Raises:
            UsageError: pandas is not installed.
        """
        return cue_rows(self.cues, self.prices).dataframe("time_s")

    def to_csv(self, path: str | Path | None = None) -> str:
        """Return the table that `airrace brief --csv` prints, as comma-separated values.

        Args:
            path: a file to be written; None for none.

        Raises:
            StorageError: the system refused.
        """
        text = cue_rows(self.cues, self.prices).csv(".10g")
        if path is not None:
            write_text(Path(path), text)
        return text

    def __repr__(self) -> str:
        return self.table().text()

    def _repr_html_(self) -> str:
        return self.table().html()


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


SENSITIVITIES_SHOWN = 30
"""The largest number of sensitivities that are shown; a data frame has all of them."""


@dataclass(frozen=True, repr=False)
class Sensitivities(Mapping[str, Sensitivity]):
    """The sensitivities of a stage by the keys of `set`, the largest first.

    Examples:
        >>> sensitivities = run.sensitivities(by="rules")
        >>> sensitivities["rules.n_z_max"].per_unit < 0.0
        True

    Attributes:
        by_key: one per number that can be changed alone.
    """

    by_key: Mapping[str, Sensitivity]

    def __getitem__(self, key: str) -> Sensitivity:
        return self.by_key[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.by_key)

    def __len__(self) -> int:
        return len(self.by_key)

    def to_dataframe(self) -> "DataFrame":
        """Return all sensitivities as a data frame of pandas, one row per key.

        An entry is empty where the inputs allow no value to that side.

        Raises:
            UsageError: pandas is not installed.
        """
        pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
        rows = {key: entry.as_object() for key, entry in self.by_key.items()}
        return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("key")

    def __repr__(self) -> str:
        return self._table.text()

    def _repr_html_(self) -> str:
        return self._table.html()

    @property
    def _table(self) -> Table:
        return sensitivities_table(list(self.values()), "sensitivities", SENSITIVITIES_SHOWN)


def stage_sensitivities(inputs: Inputs, result: StageResult, by: str | None = None) -> Sensitivities:
    """Return the sensitivity of a stage to every number that `--set` reaches, the most by a usual step first.

    Args:
        inputs: what the run was given.
        result: the stage.
        by: only the numbers of this group; None for all.

    Raises:
        UsageError: there is no such group, or course or aircraft were built in Python.
        NotCertified: the stage is no optimum, certified or solved.
    """
    from airrace.files.inputs.variation import Variation
    from airrace.flights.sensitivity.lagrangian import (
        sensitivities,  # takes compiled functions, which no reader of runs needs
    )

    groups = {group.value: group for group in ParameterGroup}
    if by is not None and by not in groups:
        raise UsageError(f"there are no sensitivities by {by!r}; known are {', '.join(groups)}")
    parameters = Variation(inputs).parameters.values()
    if by is not None:
        parameters = [parameter for parameter in parameters if parameter.group is groups[by]]
    prices = sensitivities(parameters, inputs.race, inputs.settings, result)
    return Sensitivities({price.key: price for price in sorted(prices, key=lambda price: (-price.weight, price.key))})
