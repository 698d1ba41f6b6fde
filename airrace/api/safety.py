"""Risks: how far real flights stray and what they touch, and what falls where."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Union

from airrace import options
from airrace.api.flights import AnyFlight
from airrace.api.optimize import optimize
from airrace.flights.safety.disturbances import ChosenDisturbances, Disturbances, Gusts
from airrace.options import Option

if TYPE_CHECKING:
    from airrace.api.run import Run
    from airrace.flights.results import Flight
    from airrace.flights.safety.footprint import Footprint
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_rose import SafetyRose, SafetyRuns


class SafetyOptions(ChosenDisturbances, total=False):
    """The flights, the disturbances and the pilot of `airrace.api.safety.safety`, where they are passed on."""

    flights: int
    seed: int
    threads: int | None
    replan_s: float | None
    falls: bool


def _disturbance(name: str, flag: str, unit: str, text: str) -> Option:
    """Return the option of a disturbance, which is by default that of the run's reserve."""
    return Option(
        f"{text}; by default that of the run's reserve, else {getattr(Disturbances(), name)}.", unit, flags=(flag,)
    )


def safety(
    *runs: Annotated[
        Union[str, Path, "Run"],
        Option(
            "Checkpoints of runs, such as those of several aircraft; or courses, which are solved first.",
            "RUN.h5|TRACK...",
        ),
    ],
    aircraft: Annotated[
        Sequence[options.AircraftGiven],
        Option("Fly every TRACK with this aircraft; as often as you like.", "FILE", completion="configs"),
    ] = (),
    stage: options.Stage = None,
    flights: Annotated[int, Option("How many flights.", "N")] = 1000,
    gusts: Annotated[
        str | Gusts | None, _disturbance("gusts", "--gusts", "none|light|moderate|severe", "Turbulence of MIL-F-8785C")
    ] = None,
    wind_error_kt: Annotated[
        float | None,
        _disturbance(
            "wind_error_kt", "--wind-error", "KT", "Standard deviation of the wind to the north and to the east"
        ),
    ] = None,
    mass_error_percent: Annotated[
        float | None,
        _disturbance("mass_error_percent", "--mass-error", "PERCENT", "Standard deviation of the mass"),
    ] = None,
    power_error_percent: Annotated[
        float | None,
        _disturbance("power_error_percent", "--power-error", "PERCENT", "Standard deviation of the power"),
    ] = None,
    density_error_percent: Annotated[
        float | None,
        _disturbance("density_error_percent", "--density-error", "PERCENT", "Standard deviation of the air's density"),
    ] = None,
    roll_timing_s: Annotated[
        float | None,
        _disturbance(
            "roll_timing_s", "--roll-timing", "S", "Standard deviation of the time by which rolls are late or early"
        ),
    ] = None,
    delay_s: Annotated[
        float | None, _disturbance("delay_s", "--delay", "S", "From what the pilot sees to the stick that moves")
    ] = None,
    seed: Annotated[int, Option("Of all flights; the same seed, the same flights.", "N")] = 0,
    replan_s: Annotated[
        float | None,
        Option("Also fly with the line replanned so often, the best from where it is.", "S", flags=("--replan",)),
    ] = None,
    winds: Annotated[
        str | None,
        Option("Fly the course in each of these winds first, e.g. 0,5,10kt@8: from eight directions.", "ROSE"),
    ] = None,
    threads: options.Threads = None,
    output: Annotated[
        str | Path | None,
        options.output(
            "FILE",
            "Write all numbers, .json, or a table of them, .csv; a document for an authority, .html or .pdf (needs "
            "Chromium); the envelope, .png or .svg. Documents and pictures need matplotlib.",
        ),
    ] = None,
    sign_for: Annotated[
        Sequence[str], Option("Leave a place in the document for this one to sign; as often as you like.", "NAME")
    ] = (),
    prepared_for: Annotated[str, Option("Whom the document is for.", "NAME", flags=("--for",))] = "",
    valid: Annotated[str, Option("When the document is valid, e.g. a date.", "WHEN")] = "",
    revision: Annotated[str, Option("Which revision of the document it is.", "TEXT")] = "",
    timeout: Annotated[
        float | None, Option("Stop after this time, and tell of what is flown by then.", "SECONDS")
    ] = None,
    force: options.Force = False,
    progress: bool = False,
) -> "SafetyCase | SafetyRose | SafetyRuns":
    """Fly an optimum many times with a pilot in the loop, and count what the flights touch, miss and break.

    The pilot is a model, and sees and moves late; the aircraft is that of six-dof, disturbed by gusts and by errors of
    wind, mass, power and density. Deviations are listed for every gate and leg.

    Args:
        progress: whether it is shown on stderr how far it is.

    Returns:
        The flights along one optimum, those in each wind of a rose, or those of several runs.

    Raises:
        CheckpointError: a file cannot be read.
        UsageError: a stage is not six-dof or found no flight, an argument is out of range, or the file exists.
        StorageError: the system refused to write the file.
        SolverCrash: a solver process died.
    """
    from airrace.api.run import Run
    from airrace.errors import UsageError
    from airrace.files.inputs.air import winds_named
    from airrace.pages.views.count_view import counting
    from airrace.runs.execute import ensure_time
    from airrace.runs.output import ensure_free
    from airrace.runs.run_state import RunState, open_run
    from airrace.runs.safety_case import SafetyCase
    from airrace.runs.safety_document import CaseNotes, SimulatedRun, ensure_one_course
    from airrace.runs.safety_files import ensure_safety_file, lets_fall, write_safety_file
    from airrace.runs.safety_rose import SafetyRose, SafetyRuns, fly_runs, own_case

    path = None if output is None else Path(output)
    if path is not None:
        ensure_safety_file(path, flights, len(runs) * len(aircraft or [None]))
        ensure_free(path, force=force, sources=[*runs, *aircraft])
    notes = CaseNotes(prepared_for, valid, revision, tuple(sign_for))
    if not lets_fall(path):
        in_documents = {"--sign-for": sign_for, "--for": prepared_for, "--valid": valid, "--revision": revision}
        for option, value in in_documents.items():
            if value:
                raise UsageError(f"{option} is part of a document: name one with --output, .html, .pdf or .json")
    ensure_time(timeout)
    until = math.inf if timeout is None else time.monotonic() + timeout
    if winds is not None:
        if stage is not None:
            raise UsageError("--winds and --stage exclude each other: in every wind the last stage is simulated")
        winds_named(winds)  # before anything is solved
    if replan_s is not None and (winds is not None or len(runs) * len(aircraft or [None]) != 1):
        raise UsageError("--replan compares two lines of one run in its own wind: name one run, without --winds")
    loop: SafetyOptions = {
        "flights": flights,
        "gusts": gusts,
        "wind_error_kt": wind_error_kt,
        "mass_error_percent": mass_error_percent,
        "power_error_percent": power_error_percent,
        "density_error_percent": density_error_percent,
        "roll_timing_s": roll_timing_s,
        "delay_s": delay_s,
        "seed": seed,
        "threads": threads,
        "replan_s": replan_s,
        "falls": lets_fall(path),
    }
    runs_by_name: dict[str, Run] = {}
    tracks: list[Path] = []
    for run_or_file in runs:
        if isinstance(run_or_file, RunState):
            runs_by_name[run_or_file.label] = Run.of(run_or_file)
        elif Path(run_or_file).suffix.lower() == ".h5":
            runs_by_name[str(run_or_file)] = Run.of(open_run(Path(run_or_file)))
        else:
            tracks.append(Path(run_or_file))
    if aircraft and not tracks:
        raise UsageError("--aircraft is of a TRACK that is solved first: none is named")
    for track, aircraft_ in product(tracks, aircraft or [None]):
        left = None if timeout is None else max(until - time.monotonic(), 1e-3)
        run = optimize(track, aircraft=aircraft_, threads=threads, timeout=left, progress=progress)
        runs_by_name[f"{track} {run.race.aircraft.name}"] = run

    if lets_fall(path):
        ensure_one_course(runs_by_name)

    def case_of(run: Run) -> SafetyCase | SafetyRose:
        if winds is not None:
            left = None if timeout is None else max(until - time.monotonic(), 1e-3)
            return run.safety_in_winds(winds, progress=progress, timeout=left, **loop)
        return flown_alone(run)

    def flown_alone(run: Run) -> SafetyCase:
        with counting(shown=progress) as count:
            count.begin(run.label)
            return run.stage(stage).safety(**loop, label=run.label, watch=count.watch, begin=count.begin, until=until)

    def told_of(cases: Mapping[str, SafetyCase | SafetyRose | str]) -> tuple[Run, SafetyCase]:
        """Return the first run that has flights in its own wind, and these."""
        why: UsageError | None = None
        for name, of_run in cases.items():
            run = runs_by_name[name]
            if isinstance(of_run, str):
                continue
            try:
                return run, own_case(run, of_run) or flown_alone(run)
            except UsageError as error:
                why = why or error
        raise why or UsageError("no run has flights in its own wind")

    name, run = next(iter(runs_by_name.items()))
    case = case_of(run) if len(runs_by_name) == 1 else fly_runs(runs_by_name, case_of)
    if path is not None:
        run, own = told_of(case.cases if isinstance(case, SafetyRuns) else {name: case})
        named = runs_by_name if isinstance(case, SafetyRuns) else {}
        simulated = SimulatedRun(run, run.stage(stage), replace(own, label=run.label), case, named)
        write_safety_file(path, simulated, notes)
    return case


def footprint(
    flight: AnyFlight,
    *,
    stage: options.StageOfFlights = None,
    drag_area: Annotated[
        float | None, Option("C_D A of the falling aircraft; by default C_D0 times its wing area.", "M2")
    ] = None,
    glide_ratio: Annotated[
        float | None, Option("Way over height without power; by default that of its polar.", "E")
    ] = None,
    output: Annotated[
        str | Path | None,
        options.output("FILE", "Write it: .geojson, .kml, .csv, .png, .svg or .pdf (needs matplotlib)."),
    ] = None,
    origin: options.Origin = None,
    force: options.Force = False,
) -> "tuple[Footprint, Flight]":
    """Tell what falls where: free fall and lost power from every instant of a flight, and who stands there.

    This is mechanics, not the scatter formula of an authority, and no prediction.

    Args:
        drag_area, glide_ratio: of the falling and of the gliding aircraft, see `footprint_of`.

    Returns:
        What falls where, and the flight from which it falls.

    Raises:
        CheckpointError: the file is no whole, undamaged checkpoint.
        UsageError: an argument is out of range, there is no such stage, it found no flight, or the file exists.
        StorageError: the system refused to write the file.
    """
    from airrace.runs.flight_sources import ensure_footprint_file, flight_footprint, open_flight
    from airrace.runs.output import ensure_free

    path = None if output is None else Path(output)
    if path is not None:
        ensure_footprint_file(path)
        ensure_free(path, force=force, sources=[flight])
    flight_ = open_flight(flight, stage=options.stage_text(stage))
    return flight_footprint(flight_, drag_area, glide_ratio, path, origin), flight_
