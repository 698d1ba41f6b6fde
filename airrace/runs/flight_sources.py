"""Flights by the names that every door takes: `RUN.h5`, or `RUN.h5:STAGE` for another stage than the last one."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from airrace.flights import Flight
from airrace.runs.flown_stage import FlownStage
from airrace.runs.run import Run
from airrace.runs.stored import opened_run


@dataclass(frozen=True)
class Named:
    """A flight as it was asked for: a file, and a stage or None for the last one."""

    path: Path
    stage: str | None

    @classmethod
    def of(cls, text: str) -> "Named":
        """Split `RUN.h5:STAGE`; a file whose name holds a colon comes first."""
        file, colon, stage = text.rpartition(":")
        named = colon and not Path(text).exists() and "/" not in stage and "\\" not in stage
        return cls(Path(file), stage) if named else cls(Path(text), None)


def opened_flights(texts: Sequence[str], *, stage: str | None = None) -> list[Flight]:
    """Return the flights of these names, each with a label of its own.

    Labels are as short as tells the flights apart: the stem of the file, with the stage where one file gives several
    flights or a stage was named.

    Args:
        texts: `RUN.h5` or `RUN.h5:STAGE` each.
        stage: for those that name none; None for the last one of the run.

    Raises:
        CheckpointError: a file is no whole, undamaged checkpoint.
        InputError: this version of airrace no longer accepts its inputs.
        UsageError: a run has no such stage, or that found no flight.
    """
    names = [Named.of(text) for text in texts]
    runs: dict[Path, Run] = {}
    stages: list[FlownStage] = []
    for name in names:
        if name.path not in runs:
            runs[name.path] = opened_run(name.path)
        stages.append(runs[name.path].stage(name.stage or stage))
    labels = _labels(names, stages)
    return [flown.flight(label) for flown, label in zip(stages, labels, strict=True)]


def opened_flight(text: str, *, stage: str | None = None) -> Flight:
    """Return the one flight of a name; errors as of `opened_flights`."""
    return opened_flights([text], stage=stage)[0]


def _labels(names: Sequence[Named], stages: Sequence[FlownStage]) -> list[str]:
    """Return unique labels: the file's stem, its name with the stage, its path with the stage, at last a number."""
    several = len({stage.stage for stage in stages}) > 1
    short = [
        f"{name.path.stem}:{stage.name}" if several or name.stage else name.path.stem
        for name, stage in zip(names, stages, strict=True)
    ]
    if len(set(short)) < len(short):
        short = [f"{name.path}:{stage.name}" for name, stage in zip(names, stages, strict=True)]
    if len(set(short)) < len(short):
        short = [f"{label} ({number})" for number, label in enumerate(short, start=1)]
    return short
