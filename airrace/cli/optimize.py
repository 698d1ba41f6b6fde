"""The command `airrace optimize`: from a track file to a certified flight in a checkpoint."""

from pathlib import Path
from typing import Annotated

import typer

from airrace.cli.answer import answering
from airrace.cli.options import (
    AircraftFile,
    AsJson,
    LastStage,
    Overrides,
    Quiet,
    SettingsFile,
    SigningKey,
    Threads,
    Timeout,
    TrackFile,
    WhatIsProved,
)
from airrace.procedure.settings import Explore, GuessKind
from airrace.runs.answer import unflown


def optimize(
    track: TrackFile,
    aircraft: AircraftFile = None,
    settings: SettingsFile = None,
    guess: Annotated[
        GuessKind | None, typer.Option(help="Where the point mass starts from; the settings say homotopy by default.")
    ] = None,
    explore: Annotated[
        Explore | None,
        typer.Option(help="How much is tried to find the fastest way round; the settings say quick by default."),
    ] = None,
    climb: Annotated[
        int | None, typer.Option(min=1, max=20, metavar="K", help="Take the best K ways round up the ladder.")
    ] = None,
    proof: WhatIsProved = None,
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
    sign: SigningKey = None,
    threads: Threads = None,
    timeout: Timeout = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fly a course as fast as can be.

    The flight is optimised stage by stage, and each stage is kept in a checkpoint as soon as it is finished. The last
    one is certified; those before it are solved and checked on one mesh, or certified as well with --proof all.
    """
    with answering(unflown(track.stem), as_json=as_json) as answer:
        from airrace.optimal_control.spawn import start_early
        from airrace.process import available_cores

        threads = threads or available_cores()
        start_early(1 if explore is Explore.OFF else min(2, threads))  # the other one is for what is tried beside
        from airrace.cli.running import fly
        from airrace.runs.beginning import new_task, settings_texts
        from airrace.runs.output import ensure_free
        from airrace.runs.signing import signer_of

        signer = None if sign is None else signer_of(sign)
        path = out or Path(f"{track.stem}.h5")
        ensure_free(path, force=force, remedy=f"continue it with `airrace resume {path}` or ")
        entries = [*(overrides or ()), *settings_texts(guess=guess, explore=explore, climb=climb, proof=proof)]
        task = new_task(
            track, aircraft=aircraft, settings=settings, overrides=entries, until=until, path=path, start=start
        )
        fly(answer, task.signed(signer), threads=threads, timeout=timeout, quiet=quiet)
