"""`airrace optimize`: from a track file to a certified flight in a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering, unflown
from airrace.cli.exit_codes import ExitCode
from airrace.procedure.settings import GuessKind


def optimize(
    track: Annotated[Path, typer.Argument(metavar="TRACK.yaml", readable=False, help="The course to fly.")],
    aircraft: Annotated[
        Path | None,
        typer.Option(metavar="FILE", readable=False, help="Fly this aircraft instead of the one the track names."),
    ] = None,
    settings: Annotated[
        Path | None, typer.Option(metavar="FILE", readable=False, help="Settings other than the defaults.")
    ] = None,
    guess: Annotated[
        GuessKind | None, typer.Option(help="Where the point mass starts from; the settings say homotopy by default.")
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="STAGE", help="Last stage to run; by default the last available one.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN.h5", help="Checkpoint to write; by default TRACK.h5 in the current folder."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing checkpoint.")] = False,
    overrides: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Change one value, e.g. rules.n_z_max=9 or settings.regularisation=1e-5."
        ),
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, metavar="N", help="Threads; by default all cores.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no tables.")] = False,
) -> None:
    """Fly a course as fast as can be.

    Stage by stage, each certified and kept in a checkpoint as soon as it is finished.
    """
    with answering(unflown(track.stem), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early

        start_early()
        from airrace.cli.running import ensure_free, fly, new_run, stage_named
        from airrace.cli.tables import rendered, result_tables
        from airrace.documents import load_inputs

        path = out or Path(f"{track.stem}.h5")
        ensure_free(path, force=force, remedy=f"continue it with `airrace resume {path}` or ")
        last = stage_named(until)
        entries = [*(overrides or ()), *([] if guess is None else [f"settings.guess={guess.value}"])]
        inputs = load_inputs(track, aircraft=aircraft, settings=settings, overrides=entries)
        results = fly(answer, new_run(inputs, path), finished=(), until=last, threads=threads, quiet=quiet)
        if results and answer.code is not ExitCode.INTERRUPTED and not quiet:
            answer.texts.extend(rendered(table) for table in result_tables(results[-1]))
