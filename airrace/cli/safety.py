"""Commands about risks: `safety`, how far real flights stray and what they touch; `footprint`, what falls where."""

import textwrap
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from airrace.cli.answer import PAGE, answer_with_files, answering, ensure_room, render
from airrace.cli.options import (
    AnyFlight,
    AsJson,
    Force,
    Quiet,
    StageOfFlights,
    StageOfRun,
    Threads,
    Verbose,
    complete_aircraft,
    file_option,
    output_option,
)
from airrace.safety.disturbances import (
    DENSITY_ERROR_PERCENT,
    MASS_ERROR_PERCENT,
    PILOT_DELAY,
    POWER_ERROR_PERCENT,
    ROLL_TIMING,
    WIND_ERROR_KT,
    Gusts,
)

if TYPE_CHECKING:
    from airrace.results import Flight
    from airrace.safety.footprint import Footprint


def _percent(what: str) -> typer.models.OptionInfo:
    option: typer.models.OptionInfo = typer.Option(metavar="PERCENT", help=f"Standard deviation of the {what}.")
    return option


def safety(
    run_files: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN.h5|TRACK...",
            readable=False,
            help="Checkpoints of runs, such as those of several aircraft; or courses, which are solved first.",
        ),
    ],
    aircraft: Annotated[
        list[Path] | None,
        file_option("FILE", "Fly every TRACK with this aircraft; as often as you like.", complete=complete_aircraft),
    ] = None,
    stage: StageOfRun = None,
    flights: Annotated[int, typer.Option(metavar="N", help="How many flights.")] = 1000,
    gusts: Annotated[Gusts, typer.Option(help="Turbulence of MIL-F-8785C.")] = Gusts.LIGHT,
    wind_error: Annotated[
        float, typer.Option(metavar="KT", help="Standard deviation of the wind to the north and to the east.")
    ] = WIND_ERROR_KT,
    mass_error: Annotated[float, _percent("mass")] = MASS_ERROR_PERCENT,
    power_error: Annotated[float, _percent("power")] = POWER_ERROR_PERCENT,
    density_error: Annotated[float, _percent("air's density")] = DENSITY_ERROR_PERCENT,
    roll_timing: Annotated[
        float, typer.Option(metavar="S", help="Standard deviation of the time by which rolls are late or early.")
    ] = ROLL_TIMING,
    delay: Annotated[
        float, typer.Option(metavar="S", help="From what the pilot sees to the stick that moves.")
    ] = PILOT_DELAY,
    seed: Annotated[int, typer.Option(metavar="N", help="Of all flights; the same seed, the same flights.")] = 0,
    winds: Annotated[
        str | None,
        typer.Option(
            metavar="ROSE", help="Fly the course in each of these winds first, e.g. 0,5,10kt@8: from eight directions."
        ),
    ] = None,
    threads: Threads = None,
    output: Annotated[
        Path | None,
        output_option(
            "FILE",
            "Write all numbers, .json, or a table of them, .csv; a document for an authority, .html or .pdf (needs "
            "Chromium); the envelope, .png or .svg. Documents and pictures need matplotlib.",
        ),
    ] = None,
    sign_for: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Leave a place in the document for this one to sign; as often as you like."),
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
    verbose: Verbose = False,
) -> None:
    """Fly an optimum many times with a pilot in the loop, and count what the flights touch, miss and break.

    The pilot is a model, and sees and moves late; the aircraft is that of six-dof, disturbed by gusts and by errors of
    wind, mass, power and density. Deviations are listed for every gate and leg.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.api import Run, optimize
        from airrace.errors import UsageError
        from airrace.inputs.air import winds_named
        from airrace.runs.command_result import ExitCode
        from airrace.runs.output import ensure_free
        from airrace.runs.run import open_run
        from airrace.runs.safety_case import SafetyCase
        from airrace.runs.safety_files import DOCUMENTS, NUMBERS, ensure_safety_file, write_safety_file
        from airrace.runs.safety_rose import SafetyRose, fly_runs

        ensure_room(output, as_json=as_json)
        if output is not None:
            ensure_safety_file(output, flights, len(run_files) * len(aircraft or [None]))
            ensure_free(output, force=force, sources=[*run_files, *(aircraft or ())])
        if sign_for and (output is None or output.suffix.lower() not in DOCUMENTS):
            raise UsageError("--sign-for leaves a place in a document: name one with --output, .html or .pdf")
        if winds is not None:
            if stage is not None:
                raise UsageError("--stage and --winds exclude each other: in every wind the last stage is simulated")
            winds_named(winds)  # before anything is solved
        options: dict[str, Any] = {  # Any: of many types
            "flights": flights,
            "gusts": gusts.value,
            "wind_error_kt": wind_error,
            "mass_error_percent": mass_error,
            "power_error_percent": power_error,
            "density_error_percent": density_error,
            "roll_timing_s": roll_timing,
            "delay_s": delay,
            "seed": seed,
            "threads": threads,
        }
        tracks = [path for path in run_files if path.suffix.lower() != ".h5"]
        if aircraft and not tracks:
            raise UsageError("--aircraft is of a TRACK that is solved first: none is named")
        runs = {str(path): Run.of(open_run(path)) for path in run_files if path not in tracks}
        for track, one in product(tracks, aircraft or [None]):
            found = optimize(track, aircraft=one, threads=threads, progress=not quiet)
            runs[f"{track} {found.race.aircraft.name}"] = found

        def case_of(run: Run) -> SafetyCase | SafetyRose:
            if winds is not None:
                return run.safety_in_winds(winds, progress=not quiet, **options)
            return run.stage(stage).safety(**options, label=run.label)

        run = next(iter(runs.values()))
        case = case_of(run) if len(runs) == 1 else fly_runs(runs, case_of)
        if isinstance(case, SafetyCase):
            tables, failures = [case.counts_table(), case.gates_table(), case.legs_table()], [case.uncertified]
        else:
            tables, failures = [case.table()], list(case.messages)
        answer.fields.update(case.as_object())
        if not as_json and not quiet:
            answer.texts.extend(render(table) for table in tables)
        if output is not None:
            of = None
            if output.suffix.lower() not in NUMBERS:
                view = run.stage(stage)
                own = case if isinstance(case, SafetyCase) else view.safety(**options, label=run.label)
                of = run, view, own
            write_safety_file(output, case, of, sign_for or ())
            answer_with_files(answer, [output], quiet=quiet)
        if any(failures):
            answer.fail(ExitCode.NOT_CERTIFIED, next(filter(None, failures)))


def footprint(
    name: AnyFlight,
    stage: StageOfFlights = None,
    drag_area: Annotated[
        float | None,
        typer.Option(metavar="M2", help="C_D A of the falling aircraft; by default C_D0 times its wing area."),
    ] = None,
    glide_ratio: Annotated[
        float | None, typer.Option(metavar="E", help="Way over height without power; by default that of its polar.")
    ] = None,
    output: Annotated[
        Path | None, output_option("FILE", "Write it: .geojson, .kml, .csv, .png, .svg or .pdf (needs matplotlib).")
    ] = None,
    origin: Annotated[
        str | None, typer.Option(metavar="LAT,LON,ELEV", help="Where the course lies: degrees, metres above the sea.")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Tell what falls where: free fall and lost power from every instant of a flight, and who stands there.

    This is mechanics, not the scatter formula of an authority, and no prediction.
    """
    with answering(as_json=as_json, verbose=verbose) as answer:
        from airrace.runs.flight_sources import ensure_footprint_file, flight_footprint, open_flight
        from airrace.runs.output import ensure_free

        if output is not None:
            ensure_room(output, as_json=as_json)
            ensure_footprint_file(output)
            ensure_free(output, force=force, sources=[name])
        flight = open_flight(name, stage=stage)
        found = flight_footprint(flight, drag_area, glide_ratio, output, origin)
        answer.fields.update(found.as_object())
        if not as_json and not quiet:
            answer.texts.extend(_texts(found, flight))
        answer_with_files(answer, [] if output is None else [output], quiet=quiet)


def _texts(found: "Footprint", flight: "Flight") -> Iterator[str]:
    """Yield tables of falls, glides and people, and what they are not; at most 80 columns wide."""
    from airrace.views.safety_views import falls_table, footprint_facts, people_table

    yield render(falls_table(found, flight), columns=PAGE)
    people = people_table(found, flight)
    if people.rows:
        yield render(replace(people, notes=()), columns=PAGE)
    yield from (textwrap.fill(note, PAGE) for note in people.notes)
    yield "\n".join(textwrap.fill(fact, PAGE, subsequent_indent="  ") for fact in footprint_facts(found, flight))
