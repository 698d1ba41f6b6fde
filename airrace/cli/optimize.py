"""The command `airrace optimize`: from a track file to a certified flight in a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    DryRun,
    Force,
    LastStage,
    MeshChecked,
    Overrides,
    Quiet,
    SettingsFile,
    SigningKey,
    Threads,
    Timeout,
    TrackFile,
    Verbose,
    output_option,
)
from airrace.procedure.settings import GuessKind, SearchEffort
from airrace.runs.command_result import empty_result
from airrace.standard_streams import STANDARD, stem_of


def optimize(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    guess: Annotated[
        GuessKind | None, typer.Option(help="Where the point mass starts from; the settings say homotopy by default.")
    ] = None,
    search: Annotated[
        SearchEffort | None,
        typer.Option(help="How much is tried to find the fastest route; the settings say quick by default."),
    ] = None,
    alternatives: Annotated[
        int | None, typer.Option(min=1, max=20, metavar="K", help="Take the K best routes through all stages.")
    ] = None,
    mesh_check: MeshChecked = None,
    until: LastStage = None,
    output: Annotated[
        Path | None, output_option("RUN.h5", "Checkpoint to write; by default TRACK.h5 in the current folder.")
    ] = None,
    force: Force = False,
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="OTHER.h5", readable=False, help="Start from this run's optimum of the highest stage that it holds."
        ),
    ] = None,
    overrides: Overrides = None,
    sign: SigningKey = None,
    dry_run: DryRun = False,
    threads: Threads = None,
    timeout: Timeout = None,
    as_json: AsJson = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Fly a course as fast as can be.

    The flight is optimised stage by stage, and each stage is kept in a checkpoint as soon as it is finished. The last
    one is certified; those before it are solved and checked on one mesh, or certified as well with --mesh-check all.
    """
    with answering(empty_result(stem_of(track)), as_json=as_json, verbose=verbose) as answer:
        from airrace.optimal_control.solvers.process.idle_processes import start_early
        from airrace.process import available_cores

        threads = threads or available_cores()
        if not dry_run:
            start_early(1 if search is SearchEffort.OFF else min(2, threads))  # the other is for what is tried
        from airrace.cli.running import describe_task, fly
        from airrace.errors import UsageError
        from airrace.runs.output import NO_PIPE, ensure_free
        from airrace.runs.plan import new_task, settings_texts
        from airrace.runs.signing import signer_of

        signer = None if sign is None else signer_of(sign)
        path = output or Path(f"{stem_of(track)}.h5")
        if path == STANDARD:
            raise UsageError(NO_PIPE)
        read = [track, aircraft, settings, start, sign]
        ensure_free(path, force=force, hint=f"continue it with `airrace resume {path}` or ", sources=read)
        entries = [
            *(overrides or ()),
            *settings_texts(guess=guess, search=search, alternatives=alternatives, mesh_check=mesh_check),
        ]
        task = new_task(
            track, aircraft=aircraft, settings=settings, overrides=entries, until=until, path=path, start=start
        )
        if dry_run:
            describe_task(answer, task, quiet=quiet)
            return
        fly(answer, task.signed(signer), threads=threads, timeout=timeout, quiet=quiet)
