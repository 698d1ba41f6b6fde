"""A finished stage of a run: its flight, its verdict, and how it is shown, exported and simulated."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, Unpack

import numpy as np

from airrace.errors import CheckpointError, NotCertified, UsageError
from airrace.files.export.csv import FlightOrigin, export_csv
from airrace.files.export.flight_table import Derived, FlightTable, Sampler, flight_table
from airrace.files.inputs import Inputs
from airrace.flights.results import Flight, Source, StoredOptimum, Verification, flight_of
from airrace.flights.results.clearances import distance_columns, with_distances
from airrace.flights.results.derivation import table_columns
from airrace.flights.results.stamp import Stamp
from airrace.flights.safety.disturbances import ChosenDisturbances, Disturbances
from airrace.optimal_control.certificate import Certificate
from airrace.optimal_control.trajectory import Trajectory
from airrace.pages.views.map_model import by_speed, map_model
from airrace.pages.views.plain_text import escape_html, one_line
from airrace.pages.views.plan_svg import plan_svg
from airrace.pages.views.stage_tables import certificate_table, stages_table
from airrace.procedure import stored_stages
from airrace.procedure.result import StageResult
from airrace.procedure.stage import Stage
from airrace.race import Race
from airrace.runs.json_objects import stage_object, stamp_object
from airrace.runs.output import write_or_return
from airrace.runs.reserve_attempts import reserve_state
from airrace.runs.stage_data import Brief, Sensitivities, Splits, stage_sensitivities
from airrace.runs.verdict import downgrade_stale, run_line, verdict

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from airrace.flights.results.duals import ConstraintMultipliers, NamedArray
    from airrace.flights.safety.monte_carlo import Watch
    from airrace.optimal_control.casadi_nlp import CasadiNlp
    from airrace.optimal_control.problem import Iterate, Problem
    from airrace.runs.safety_case import Begin, SafetyCase


def run_page(race: Race, name: str, results: Sequence[StageResult]) -> str:
    """Return the stages, the gate splits of the last one, and its flight from above, as HTML."""
    title = f"{race.course.name}, flown by {race.aircraft.name}"
    stages = replace(stages_table(results), title=title).html()
    sentence = verdict(results)[1] if results else "no stage is finished yet"
    remark = f"<p>{escape_html(sentence)}</p>" if sentence else ""
    return f"<div>{stages}{remark}{_flight_html(race, results[-1]) if results else ''}</div>"


def stage_page(race: Race, result: StageResult) -> str:
    """Return one stage as HTML: its gate splits, its flight from above, and its certificate."""
    certificate, items_html = result.certificate, ""
    if certificate is not None:
        items_html = certificate_table(certificate, f"certificate ({certificate.solver_status})").html()
    line = escape_html(run_line(race.course.name, [result]))
    return f"<div><p><b>{line}</b></p>{_flight_html(race, result)}{items_html}</div>"


def _flight_html(race: Race, result: StageResult) -> str:
    """Return splits and picture as HTML; empty if no flight was found."""
    if not result.is_flight:
        return ""
    track = np.stack([result.trajectory["x"], result.trajectory["y"]], axis=1)
    plan = plan_svg(map_model(race).with_track(track), by_speed(track, result.trajectory["V_K"]))
    return f"{Splits(result.splits).to_html()}{plan}"


@dataclass(frozen=True, eq=False, repr=False)
class StageView:
    """A stage of a run: the optimum that one fidelity of the aircraft found, and its certificate.

    Examples:
        >>> run["point-mass"]
        <StageView half_cuban_eight: point-mass, 8.908 s, certified>
        >>> run["point-mass"].to_dataframe(rate=10).index[:3].tolist()
        [0.0, 0.1, 0.2]

    Attributes:
        inputs: what the run was given.
        result: all that the procedure handed on: histories, multipliers, attempts, timings.
        versions: the versions of airrace and of the libraries that have computed it.
        stale: why the stage no longer stands, a clause; empty where it does.
        verification: the outcome of measuring it again; None where that was no question.
        attempts: that the search for the run's reserve has made; 0 where it has ended.
    """

    inputs: Inputs
    result: StageResult
    versions: Mapping[str, str]
    stale: str = ""
    verification: Verification | None = None
    attempts: int = 0

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
    def status(self) -> str:
        """The trust that the stage deserves: `certified`, `solved` (all but the race time on a second mesh), `a guess`,
        `not certified`, or why no flight was found."""
        return self.result.status.value

    @property
    def certificate(self) -> Certificate | None:
        """The measurements of the optimum; None if nothing is measured by design (the homotopy)."""
        return self.result.certificate

    @property
    def message(self) -> str:
        """A sentence on what users should know, such as the limit that cannot be met; often empty."""
        return self.result.remarks

    @property
    def trajectory(self) -> Trajectory:
        """The named histories on the nodes of the mesh, SI and radians."""
        return self.result.trajectory

    @property
    def splits(self) -> Splits:
        """The gate splits: when and how every gate was passed; empty if no flight was found."""
        return Splits(self.result.splits if self.result.is_flight else ())

    @property
    def costates(self) -> "NamedArray":
        """The costates at the ends of the intervals, s per unit of each state; signs as in `flights.results.duals`.

        Raises:
            NotCertified: the stage is no optimum.
        """
        from airrace.flights.results.duals import costates  # takes the problem, which no reader of runs needs

        problem, _ = self._discretised
        return costates(problem, self.result)

    @property
    def hamiltonian(self) -> "NamedArray":
        """The Hamiltonian at the ends of the intervals, -1 along an optimum; errors as of `costates`."""
        from airrace.flights.results.duals import hamiltonian  # takes the problem, which no reader of runs needs

        problem, iterate = self._discretised
        return hamiltonian(problem, iterate, self.result)

    @property
    def multipliers(self) -> "ConstraintMultipliers":
        """The multipliers of all limits along the path and at passages, s per unit; errors as of `costates`."""
        from airrace.flights.results.duals import multipliers  # takes the problem, which no reader of runs needs

        problem, _ = self._discretised
        return multipliers(problem, self.result)

    def to_casadi(self) -> "CasadiNlp":
        """Return the discretised problem as a nonlinear program of CasADi that begins at this optimum; errors as of
        `costates`."""
        from airrace.optimal_control.casadi_nlp import to_casadi  # takes kernels, likewise

        return to_casadi(*self._discretised)

    @property
    def _discretised(self) -> "tuple[Problem, Iterate]":
        if self.result.certificate is None:
            raise NotCertified(f"{self.name} is no optimum: it has no multipliers")
        from airrace.flights.results.duals import discretise

        return discretise(self.inputs.race, self.inputs.settings, self.result)

    def flight(self, label: str | None = None) -> Flight:
        """Return the flight with all histories that follow from it, and its gate crossings; see `flights.results`.

        Args:
            label: what people call it; None for the track's name and the stage.

        Raises:
            UsageError: the stage found no flight.
            CheckpointError: what follows from its histories has no bounds, so no aircraft can fly it.
        """
        if not self.result.is_flight:
            raise UsageError(f"{self.name} found no flight: it ended {self.result.outcome.value}")
        source = self._source(label or f"{one_line(Path(self.inputs.track.path).stem)}:{self.name}")
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            flight = with_distances(flight_of(self.inputs.race, self.result, source))
        for name, history in flight.histories.items():
            if np.isinf(history.values).any():
                raise CheckpointError(f"{self.name}: its histories are of no flight: {name} becomes infinite")
        return flight

    @property
    def stamp(self) -> Stamp:
        """What the stage's flight is: stage, certificate, aircraft, air, pilot's limits and reserve."""
        return self._source("").stamp(self.inputs.race)

    def _source(self, label: str) -> Source:
        return Source(
            label,
            stage=self.name,
            status=self.result.status,
            version=self.versions.get("airrace", ""),
            remark=self.message,
            verification=self.verification,
            failed=self._failed,
            pilot=self.inputs.pilot,
            reserve=reserve_state(self.inputs.reserve, self.attempts),
            optimum=self._optimum,
        )

    @property
    def _optimum(self) -> StoredOptimum | None:
        """The optimum with its multipliers; None where the stage has none, or no longer stands."""
        if self.stale or self.result.certificate is None or not self.result.is_flight:
            return None
        return StoredOptimum(self.inputs.race, self.inputs.settings, self.result)

    @property
    def _failed(self) -> tuple[str, ...]:
        """The items of the certificate that fail, or what else speaks against it."""
        if self.stale:
            return ("it no longer stands",)
        if self.verification is not None and self.verification.refutation:
            return (self.verification.outcome,)
        certificate = self.result.certificate
        return () if certificate is None else tuple(item.name for item in certificate.failed)

    def cues(self, *, lateness: bool = False) -> Brief:
        """Return what the pilot does, leg by leg, as `airrace brief` prints it.

        Args:
            lateness: whether every cue has its price of lateness; each is solved twice.

        Raises:
            UsageError: the stage found no flight.
            NotCertified: prices were asked for, and the stage is no optimum, or no longer stands.
        """
        brief = Brief.of(self.flight())
        if not lateness:
            return brief
        if self.stale:
            raise NotCertified(f"{self.name} has no prices of lateness: {self.stale}")
        return brief.with_prices(self.inputs, self.result)

    def to_dataframe(self, rate: float | None = None) -> "DataFrame":
        """Return the flight as a data frame of pandas: the columns of `airrace export csv`, over the time in seconds.

        Columns name their units, angles are in degrees. `phase` is the leg that a row belongs to. The frame's `attrs`
        are those of `to_xarray`.

        Args:
            rate: rows per second; None for one row per node of the mesh.

        Raises:
            UsageError: pandas is not installed, or the rate cannot be exported.
        """
        from airrace.files.export.flight_table import flight_frame

        frame = flight_frame(self._flight(rate))
        frame.attrs.update(self._provenance.attributes(self.result))
        return frame

    def to_xarray(self, rate: float | None = None) -> "Dataset":
        """Return the flight as a dataset of xarray over the dimension `time`: SI and radians, units in the attributes.

        Args:
            rate: see `to_dataframe`.

        Raises:
            UsageError: xarray is not installed, or the rate cannot be exported.
        """
        from airrace.files.export.netcdf import flight_dataset

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
        return write_or_return(path, lambda stream: self.write_csv(stream, rate))

    def write_csv(self, stream: TextIO, rate: float | None = None) -> None:
        """Write the flight as comma-separated values, as `to_csv` does, to a stream that is open."""
        derived, sampler = self._derived, self._sampler(rate)
        export_csv(self.result, stream, rate_hz=rate, derived=derived, sampler=sampler, provenance=self._provenance)

    def sensitivities(self, by: str | None = None) -> Sensitivities:
        """Return the sensitivity of the race time to every number of the inputs, in seconds per unit (shadow prices).

        Nothing is solved again. The costliest numbers come first.

        Args:
            by: only the numbers of `track`, `aircraft`, `rules` or `environment`.

        Raises:
            NotCertified: the stage is no optimum, certified or solved, was solved roughly, or no longer stands.
            UsageError: there is no such group, or course or aircraft were built in Python.
        """

        if self.stale:
            raise NotCertified(f"{self.name} has no sensitivities: {self.stale}")
        return stage_sensitivities(self.inputs, self.result, by)

    def safety(
        self,
        *,
        flights: int = 1000,
        seed: int = 0,
        threads: int | None = None,
        label: str | None = None,
        replan_s: float | None = None,
        falls: bool = False,
        watch: "Watch | None" = None,
        begin: "Begin | None" = None,
        until: float = math.inf,
        **chosen: Unpack[ChosenDisturbances],
    ) -> "SafetyCase":
        """Fly the optimum many times with a pilot in the loop, in gusts and with errors, as `airrace safety` does.

        Args:
            flights: how many; flight k is the same however many there are.
            seed: of all flights.
            threads: None for one per processor.
            label: what people call the flight; None for the track's name and the stage.
            replan_s: the time after which the best that is left is solved anew as the line that is followed; then all
                is flown twice, with the line fixed and with it replanned.
            falls: whether the flights are let fall, too, from every tenth of a second.
            watch: is told how many flights are flown, of how many, and how many of these break a rule.
            begin: is told of replanned flights before they are watched.
            until: the time of the monotonic clock, s, at which flights end; those that are flown count.
            chosen: disturbances; else those that the run's reserve was asked for in, without one those of
                `airrace.flights.safety.disturbances.Disturbances`.

        Raises:
            UsageError: the stage is not six-dof or found no flight, or an argument is out of range.
            SolverCrash: a solver process died.
        """
        from airrace.flights.safety.monte_carlo import unwatched  # takes what flies, likewise
        from airrace.runs.safety_case import fly_safety_case, unannounced

        reserve = self.inputs.reserve
        usual = Disturbances() if reserve is None else Disturbances.of_reserve(reserve)
        disturbances = replace(usual, **{name: value for name, value in chosen.items() if value is not None})
        name = label or f"{one_line(Path(self.inputs.track.path).stem)}:{self.name}"
        result = downgrade_stale(self.result, self.stale)
        return fly_safety_case(
            self.inputs.race,
            result,
            name,
            flights,
            disturbances,
            seed=seed,
            threads=threads,
            replan=None if replan_s is None else (replan_s, self.inputs.settings),
            penalties=self.inputs.penalties,
            falls=falls,
            watch=watch or unwatched,
            begin=begin or unannounced,
            until=until,
        )

    def as_object(self) -> dict[str, object]:
        """Return the object of this stage in `airrace show --json`."""
        return stage_object(self.result) | {"stamp": stamp_object(self.stamp)}

    def __repr__(self) -> str:
        return f"<StageView {run_line(one_line(Path(self.inputs.track.path).stem), [self.result])}>"

    def _repr_html_(self) -> str:
        return stage_page(self.inputs.race, self.result)

    @property
    def _provenance(self) -> FlightOrigin:
        return FlightOrigin(self.inputs.race.course.name, self.stamp, self.versions.get("airrace", "unknown"))

    @property
    def _derived(self) -> Derived:
        race, states = self.inputs.race, [quantity.name for quantity in self.result.trajectory.states]
        return {
            **stored_stages.derived_quantities(race, self.result),
            **table_columns(race, states),
            **distance_columns(race, states),
        }

    def _sampler(self, rate: float | None) -> Sampler | None:
        """Return what integrates between the nodes; None without a rate, for on the mesh it is not needed."""
        return None if rate is None else stored_stages.sampler(self.inputs.race, self.result)

    def _flight(self, rate: float | None) -> FlightTable:
        trajectory = self.result.trajectory
        return flight_table(trajectory, rate_hz=rate, derived=self._derived, sampler=self._sampler(rate))
