"""`airrace optimize`: from a track file to a certified flight in a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering, unflown
from airrace.cli.options import AircraftFile, AsJson, LastStage, Overrides, Quiet, SettingsFile, Threads, TrackFile
from airrace.procedure.settings import GuessKind


def optimize(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    guess: Annotated[
        GuessKind | None, typer.Option(help="Where the point mass starts from; the settings say homotopy by default.")
    ] = None,
    until: LastStage = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN.h5", help="Checkpoint to write; by default TRACK.h5 in the current folder."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing checkpoint.")] = False,
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="OTHER.h5", readable=False, help="Start from this run's optimum of the highest stage that it holds."
        ),
    ] = None,
    overrides: Overrides = None,
    threads: Threads = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fly a course as fast as can be.

    Stage by stage, each certified and kept in a checkpoint as soon as it is finished.
    """
    with answering(unflown(track.stem), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early

        start_early()
        from airrace.cli.running import ensure_free, fly, new_run, stage_named
        from airrace.documents import load_inputs

        path = out or Path(f"{track.stem}.h5")
        ensure_free(path, force=force, remedy=f"continue it with `airrace resume {path}` or ")
        last = stage_named(until)
        entries = [*(overrides or ()), *([] if guess is None else [f"settings.guess={guess.value}"])]
        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=entries)
        run = new_run(inputs, path)
        other = None
        if start is not None:
            from airrace.cli.starting import another, ensure_other_file, other_run

            ensure_other_file(start, path)
            other = another(other_run(start), run, last)
        fly(answer, run, finished=(), until=last, threads=threads, quiet=quiet, start=other)
