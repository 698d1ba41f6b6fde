"""Planning of a batch: every combination becomes a job, is named, compared with what is done, and checked."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from airrace.batch.checking import Family, Findings, refused_jobs
from airrace.batch.job import Job
from airrace.batch.plan import BatchPlan, PlannedJob, invalid, result_of
from airrace.batch.record import Choice, reason_to_fly
from airrace.batch.sources import Manner, SourceGroup, Sources
from airrace.batch.sweep import Combination, combinations, count, job_name, refuse_clashes
from airrace.errors import Finding, InputError, UsageError
from airrace.inputs import Document, read_documents
from airrace.inputs.document import read_document
from airrace.records import record
from airrace.runs.output import ensure_unread

JOBS_MAX = 100_000
"""The largest number of jobs of a batch."""

AIRCRAFT_KEY = "aircraft"
"""The key with which a track names its aircraft; it may be set and swept like any other."""


@record
class _Steps:
    """The steps of one course and aircraft."""

    manner: Manner
    steps: tuple[PlannedJob, ...]


def make_plan(sources: Sources, folder: Path, *, until: str, versions: str, choice: Choice = Choice.NONE) -> BatchPlan:
    """Return the plan of a batch: everything that is found out before anything is flown.

    Args:
        until: the last stage where nobody names one.
        versions: the versions of airrace and of what its numbers depend on.
        choice: which finished jobs are flown again.

    Raises:
        InputError: a settings file cannot be read, or a value is both set and swept.
        UsageError: two jobs would write the same file or one that is read, or there are too many.
    """
    total = sum(_jobs_of(group) for group in sources.groups)
    if total > JOBS_MAX:
        raise UsageError(f"these are {total} jobs; at most {JOBS_MAX} are flown at once")
    reader = _DocumentCache()
    families = [
        family
        for group in sources.groups
        for family in _families(group, reader, until=group.manner.until or until, versions=versions)
    ]
    refuse_clashes((step.name, _origin(step)) for family in families for step in family.steps)
    decided = [
        replace(family, steps=tuple(_decided(step, folder, choice) for step in family.steps)) for family in families
    ]
    refused = refused_jobs(
        [Family(one.manner.sweeps, one.manner.places, jobs) for one in decided if (jobs := _to_fly(one))]
    )
    steps = tuple(_checked(step, refused.get(step.name)) for family in decided for step in family.steps)
    read = [file for step in steps for file in (step.track, step.aircraft) if file is not None]
    read += [str(file) for file in (*sources.files, *(one.manner.settings for one in sources.groups)) if file]
    plan = BatchPlan(folder, steps, sources.findings, tuple(dict.fromkeys(read)))
    ensure_unread(plan.files(), plan.read)
    return plan


class _DocumentCache:
    """A reader that reads every file once, and keeps every text once."""

    def __init__(self) -> None:
        self._documents: dict[Document, Document] = {}

    def documents(self, course: Path, aircraft: Path | None, overrides: Sequence[str]) -> tuple[Document, Document]:
        track, flown = read_documents(course, aircraft=aircraft, overrides=overrides)
        return self._once(track), self._once(flown)

    def settings(self, path: Path | None) -> Document | None:
        if path is None:
            return None
        findings: list[Finding] = []
        document = read_document(path, findings)
        if document is None:
            raise InputError(findings)
        return self._once(document)

    def _once(self, document: Document) -> Document:
        return self._documents.setdefault(document, document)


def _families(group: SourceGroup, reader: _DocumentCache, *, until: str, versions: str) -> Iterator[_Steps]:
    manner = group.manner
    _refuse_ambiguity(manner)
    settings = reader.settings(manner.settings)
    for course in group.courses:
        for aircraft in manner.aircraft or (None,):
            try:
                jobs = tuple(_jobs(course, aircraft, settings, manner, reader, until=until, versions=versions))
            except InputError as error:
                name = job_name(course, aircraft, ())
                flown = None if aircraft is None else str(aircraft)
                known = invalid(tuple(error.findings))
                yield _Steps(manner, (PlannedJob(name, course.stem, str(course), flown, (), None, known=known),))
                continue
            yield _Steps(manner, tuple(_step(job) for job in jobs))


def _jobs(
    course: Path,
    aircraft: Path | None,
    settings: Document | None,
    manner: Manner,
    reader: _DocumentCache,
    *,
    until: str,
    versions: str,
) -> Iterator[Job]:
    """Yield one job for every combination of swept values.

    Raises:
        InputError: the track or the aircraft cannot be read.
    """
    read: dict[tuple[str, ...], tuple[Document, Document]] = {}
    for swept in combinations(manner.sweeps):
        overrides = (*manner.overrides, *(f"{key}={value}" for key, value in swept))
        naming = tuple(one for one in overrides if one.partition("=")[0].strip() == AIRCRAFT_KEY)
        if naming not in read:
            read[naming] = reader.documents(course, aircraft, naming)
        track, flown = read[naming]
        name = job_name(course, aircraft, swept)
        yield Job(name, course.stem, track, flown, settings, overrides, swept, until, versions)


def _step(job: Job) -> PlannedJob:
    return PlannedJob(job.name, job.course, job.track.path, job.aircraft.path, job.swept, job)


def _decided(step: PlannedJob, folder: Path, choice: Choice) -> PlannedJob:
    if step.job is None:
        return step
    reason, record = reason_to_fly(step.job, folder, choice)
    return replace(step, reason=reason, known=result_of(record) if record and not reason else None)


def _to_fly(family: _Steps) -> list[Job]:
    return [step.job for step in family.steps if step.job and step.known is None]


def _checked(step: PlannedJob, findings: Findings | None) -> PlannedJob:
    return step if findings is None else replace(step, reason="", known=invalid(findings))


def _jobs_of(group: SourceGroup) -> int:
    return len(group.courses) * max(1, len(group.manner.aircraft)) * count(group.manner.sweeps)


def _refuse_ambiguity(manner: Manner) -> None:
    set_keys = {text.partition("=")[0].strip() for text in manner.overrides}
    both = [sweep.key for sweep in manner.sweeps if sweep.key in set_keys]
    if both:
        raise InputError([Finding("--sweep", 0, 0, key, "is swept, and set as well; do one of them") for key in both])


def _origin(step: PlannedJob) -> str:
    """Return what a job is made of, in the user's words."""
    return " ".join([step.track, *_origin_of(step.aircraft, step.swept)])


def _origin_of(aircraft: str | None, swept: Combination) -> Iterator[str]:
    if aircraft is not None:
        yield f"(with {aircraft})"
    if swept:
        yield f"({', '.join(f'{key}={value}' for key, value in swept)})"
