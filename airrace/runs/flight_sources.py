"""Flights by the names that every door takes.

`RUN.h5` is the last stage of a run, `RUN.h5:STAGE` another one, `FLOWN.h5` an imported log, and `LOG.csv` a log itself.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from airrace.checkpoint import Recorded, read_stored
from airrace.errors import UsageError
from airrace.logs.reading import is_log
from airrace.results import Flight
from airrace.runs.log_view import LogView, opened_log
from airrace.runs.run import Run
from airrace.runs.sources import Named
from airrace.runs.stage_view import StageView
from airrace.runs.stored_inputs import readable, stored_run
from airrace.standard_streams import stem_of


def opened_flights(texts: Sequence[str], *, stage: str | None = None) -> list[Flight]:
    """Return the flights of these names, each with a label of its own.

    Labels are as short as tells the flights apart: the stem of the file, with the stage where one file gives several
    flights or a stage was named. A log that is not imported yet is flown through the course of the first file that has
    one.

    Args:
        texts: `RUN.h5`, `RUN.h5:STAGE`, a flown log `FLOWN.h5`, or a log itself each.
        stage: for runs whose names say none; None for their last ones.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs, or a log is not valid.
        UsageError: a run has no such stage, or that found no flight, or no course is at hand for a log.
    """
    names = [Named.of(text) for text in texts]
    kept = {name.path: opened_file(name.path) for name in names if not _is_log(name)}
    sources = [_source(name, kept, stage) for name in names]
    labels = _labels(names, sources)
    return [source.flight(label) for source, label in zip(sources, labels, strict=True)]


def opened_flight(text: str, *, stage: str | None = None) -> Flight:
    """Return the one flight of a name; errors as of `opened_flights`."""
    return opened_flights([text], stage=stage)[0]


def opened_file(path: Path) -> Run | LogView:
    """Return the run or the flown log in a file; errors as of `opened_flights`."""
    stored = read_stored(path)
    return opened_log(stored) if isinstance(stored, Recorded) else readable(stored_run(stored, path))


def source_of(kept: Run | LogView, stage: str | None) -> StageView | LogView:
    """Return the stage of a run, None for its last one, or a flown log, which has no stages.

    Raises:
        UsageError: there is no such stage.
    """
    if isinstance(kept, Run):
        return kept.stage(stage)
    if stage is not None:
        raise UsageError(f"a flown log has no stages; leave `{stage}` out")
    return kept


def _is_log(name: Named) -> bool:
    return name.stage is None and is_log(name.path)


def _source(name: Named, kept: Mapping[Path, Run | LogView], stage: str | None) -> StageView | LogView:
    if not _is_log(name):
        one = kept[name.path]
        return source_of(one, name.stage or (stage if isinstance(one, Run) else None))
    if not kept:
        raise UsageError(
            f"no course is at hand for the log {name.path}; import it with `airrace import {name.path} --course TRACK`"
        )
    # Imported here: runs and imported logs are read without whatever makes a flight of a log.
    from airrace.runs.log_import import flown_through

    return flown_through(name.path, next(iter(kept.values())).inputs)


def _labels(names: Sequence[Named], sources: Sequence[StageView | LogView]) -> list[str]:
    """Return unique labels: the file's stem, its name with the stage, its path with the stage, at last a number."""
    stages = [source.name if isinstance(source, StageView) else "" for source in sources]
    several = len(set(filter(None, stages))) > 1
    short = [
        f"{stem_of(name.path)}:{stage}" if stage and (several or name.stage) else stem_of(name.path)
        for name, stage in zip(names, stages, strict=True)
    ]
    if len(set(short)) < len(short):
        short = [f"{name.path}:{stage}" if stage else f"{name.path}" for name, stage in zip(names, stages, strict=True)]
    if len(set(short)) < len(short):
        short = [f"{label} ({number})" for number, label in enumerate(short, start=1)]
    return short
