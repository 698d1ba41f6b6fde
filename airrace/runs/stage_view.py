"""A finished stage of a run: its flight, and what can be told of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from airrace.errors import CheckpointError, NotCertified, UsageError
from airrace.export.csv import Provenance, export_csv
from airrace.export.flight_table import Derived, FlightTable, Sampler, flight_table
from airrace.inputs import Inputs
from airrace.optimal_control.certificate import Certificate
from airrace.procedure import results_api
from airrace.procedure.result import Stage, StageResult
from airrace.results import Flight, Source, flight_of
from airrace.results.derivation import table_columns
from airrace.runs.output import written_or_returned
from airrace.runs.run_object import stage_object
from airrace.runs.run_page import run_line, stage_page
from airrace.runs.splits import Splits
from airrace.trajectory import Trajectory
from airrace.views.plain_text import one_line

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from airrace.runs.sensitivities import Prices


@dataclass(frozen=True, eq=False, repr=False)
class StageView:
    """A stage of a run: the optimum that one fidelity of the aircraft found, and its certificate.

    Examples:
        >>> run["point-mass"]
        <FlownStage half_cuban_eight: point-mass, 8.634 s, certified>
        >>> run["point-mass"].to_dataframe(rate=10).index[:3].tolist()
        [0.0, 0.1, 0.2]

    Attributes:
        inputs: what the run was given.
        result: all that the procedure handed on: histories, multipliers, attempts, timings.
        versions: the versions of airrace and of the libraries that have computed it.
        stale: why the stage no longer stands, a clause; empty where it does.
    """

    inputs: Inputs
    result: StageResult
    versions: Mapping[str, str]
    stale: str = ""

    @property
    def name(self) -> str:
        """The name of the stage, e.g. `point-mass`."""
        return self.result.stage.value

    @property
    def stage(self) -> Stage:
        """The stage of the procedure that this is."""
        return self.result.stage

    @property
    def race_time(self) -> float:
        """The race time, s; NaN if no flight was found."""
        return self.result.trajectory.race_time if self.result.is_flight else math.nan

    @property
    def certified(self) -> bool:
        """Whether the stage found an optimum, and its certificate holds and is complete."""
        return self.result.certified

    @property
    def state(self) -> str:
        """The trust that the stage deserves: `certified`, `solved` (all but the race time on a second mesh), `a guess`,
        `not certified`, or why no flight was found."""
        return self.result.state.value

    @property
    def certificate(self) -> Certificate | None:
        """The measurements of the optimum; None if nothing is measured by design (the homotopy)."""
        return self.result.certificate

    @property
    def message(self) -> str:
        """A sentence on what users should know, such as the limit that cannot be kept; often empty."""
        return self.result.remarks

    @property
    def trajectory(self) -> Trajectory:
        """The named histories on the nodes of the mesh, SI and radians."""
        return self.result.trajectory

    @property
    def splits(self) -> Splits:
        """The gate splits: when and how every gate was passed; empty if no flight was found."""
        return Splits(self.result.splits if self.result.is_flight else ())

    def flight(self, label: str | None = None) -> Flight:
        """Return the flight with all histories that follow from it, and its gate crossings; see `airrace.results`.

        Args:
            label: what people call it; None for the track's name and the stage.

        Raises:
            UsageError: the stage found no flight.
            CheckpointError: what follows from its histories has no bounds, so nobody can have flown it.
        """
        if not self.result.is_flight:
            raise UsageError(f"{self.name} found no flight: it ended {self.result.outcome.value}")
        source = Source(
            label or f"{one_line(Path(self.inputs.track.path).stem)}:{self.name}",
            stage=self.name,
            state=self.result.state,
            version=self.versions.get("airrace", ""),
            remark=self.message,
        )
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            flight = flight_of(self.inputs.race, self.result, source)
        for name, one in flight.histories.items():
            if np.isinf(one.values).any():
                raise CheckpointError(f"{self.name}: its histories are of no flight: {name} becomes infinite")
        return flight

    def to_dataframe(self, rate: float | None = None) -> "DataFrame":
        """Return the flight as a data frame of pandas: the columns of `airrace export csv`, over the time in seconds.

        Columns name their units, angles are in degrees. `phase` is the leg that a row belongs to.

        Args:
            rate: rows per second; None for one row per node of the mesh.

        Raises:
            UsageError: pandas is not installed, or the rate cannot be exported.
        """
        from airrace.export.flight_table import flight_frame

        return flight_frame(self._flight(rate))

    def to_xarray(self, rate: float | None = None) -> "Dataset":
        """Return the flight as a dataset of xarray over the dimension `time`: SI and radians, units in the attributes.

        Args:
            rate: see `to_dataframe`.

        Raises:
            UsageError: xarray is not installed, or the rate cannot be exported.
        """
        from airrace.export.netcdf import flight_dataset

        return flight_dataset(self._flight(rate), self.result, self._provenance)

    def to_csv(self, path: str | Path | None = None, rate: float | None = None) -> str:
        """Return or write the flight as comma-separated values, as `airrace export csv` writes them.

        Args:
            path: a file to be written; None for none.
            rate: see `to_dataframe`.

        Returns:
            The text; empty where a file is written, which may be larger than the memory.

        Raises:
            UsageError: the rate cannot be exported.
            StorageError: the system refused.
        """
        return written_or_returned(path, lambda stream: self.write_csv(stream, rate))

    def write_csv(self, stream: TextIO, rate: float | None = None) -> None:
        """Write the flight as comma-separated values, as `to_csv` does, to a stream that is open."""
        derived, sampler = self._derived, self._sampler(rate)
        export_csv(self.result, stream, rate_hz=rate, derived=derived, sampler=sampler, provenance=self._provenance)

    def sensitivities(self, by: str | None = None) -> "Prices":
        """Return the sensitivity of the race time to every number of the inputs, in seconds per unit (shadow prices).

        Nothing is solved again. The dearest numbers come first.

        Args:
            by: only the numbers of `track`, `aircraft`, `rules` or `environment`.

        Raises:
            NotCertified: the stage is no optimum, certified or solved, or no longer stands.
            UsageError: there is no such group, or course or aircraft were built in Python.
        """
        from airrace.runs.sensitivities import priced

        if self.stale:
            raise NotCertified(f"{self.name} has no sensitivities: {self.stale}")
        return priced(self.inputs, self.result, by)

    def as_object(self) -> dict[str, object]:
        """Return the object of this stage in `airrace show --json`."""
        return stage_object(self.result)

    def __repr__(self) -> str:
        return f"<FlownStage {run_line(one_line(Path(self.inputs.track.path).stem), [self.result])}>"

    def _repr_html_(self) -> str:
        return stage_page(self.inputs.race, self.result)

    @property
    def _provenance(self) -> Provenance:
        race = self.inputs.race
        return Provenance(race.course.name, race.aircraft.name, self.versions.get("airrace", "unknown"))

    @property
    def _derived(self) -> Derived:
        race, states = self.inputs.race, [one.name for one in self.result.trajectory.states]
        return {
            **results_api.derived_quantities(race, self.result),
            **table_columns(race, states),
        }

    def _sampler(self, rate: float | None) -> Sampler | None:
        """Return what integrates between the nodes; None without a rate, for on the mesh it is not needed."""
        return None if rate is None else results_api.sampler(self.inputs.race, self.result)

    def _flight(self, rate: float | None) -> FlightTable:
        trajectory = self.result.trajectory
        return flight_table(trajectory, rate_hz=rate, derived=self._derived, sampler=self._sampler(rate))
