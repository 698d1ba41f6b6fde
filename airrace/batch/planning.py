"""Planning of a batch: every combination becomes a job, is compared with what is done, and checked."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, zip_longest
from pathlib import Path
from typing import Any

from airrace.batch.jobs import Combination, Job, Sweep, combinations, count, cover, job_name, refuse_clashes
from airrace.batch.record import Choice, JobRecord, checkpoint_path, reason_to_fly, record_path
from airrace.batch.sources import Manner, SourceGroup, Sources
from airrace.errors import Finding, InputError, UsageError
from airrace.inputs import Document, inputs_from_documents, read_documents
from airrace.inputs.document import read_document
from airrace.inputs.nodes import Place
from airrace.inputs.overrides import FILE as SET_OPTION
from airrace.records import record
from airrace.runs.command_result import ExitCode
from airrace.runs.output import ensure_unread


@record
class RouteSummary:
    """The routes that a job has tried, in short.

    Attributes:
        flown: the route that was proved, in words.
        tried: how many there were, this one among them.
        next: the fastest of the others, in words; empty where there is none.
        behind: the time by which that one is behind on the rough mesh, s; None if there is none.
    """

    flown: str
    tried: int
    next: str = ""
    behind: float | None = None


# Any: JSON
def routes_of(run: Mapping[str, Any] | None) -> RouteSummary | None:
    """Return the routes of the stage that explored, from the object of `airrace optimize --json`; None without one."""
    told = [stage["routes"] for stage in (run or {}).get("stages", ()) if stage.get("routes")]
    if not told:
        return None
    flown, *others = told[0]
    if not others:
        return RouteSummary(flown["route"], 1)
    return RouteSummary(flown["route"], 1 + len(others), others[0]["route"], others[0]["difference_s"])


@record
class JobResult:
    """The end of a job in short, for there may be thousands.

    Attributes:
        code: the exit code that `airrace optimize` would have ended with.
        message: what went wrong; empty if nothing did.
        race_time: the race time of the last stage, s; None without a flight.
        wall: the wall time of the attempt that ended it, s.
        retries: why earlier attempts did not end it.
        findings: what is wrong with the inputs.
        routes: which route was flown; None where no other was tried.
        stage: the last one that is finished; empty where none is.
        laps: lap times of that stage, s; empty for a race of one lap.
    """

    code: int
    message: str = ""
    race_time: float | None = None
    wall: float = 0.0
    retries: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
    routes: RouteSummary | None = None
    stage: str = ""
    laps: tuple[float, ...] = ()


def result_of(record: JobRecord) -> JobResult:
    """Return what a record says."""
    stages: Sequence[Mapping[str, Any]] = (record.run or {}).get("stages") or ({},)  # Any: JSON
    return JobResult(
        record.code,
        record.message,
        record.race_time,
        record.wall,
        record.retries,
        record.findings,
        routes_of(record.run),
        stage=stages[-1].get("stage", ""),
        laps=tuple(stages[-1].get("lap_times_s", ())),
    )


def invalid(findings: tuple[Finding, ...]) -> JobResult:
    """Return the result of a job whose inputs are not valid."""
    number = len(findings)
    message = f"the input is not valid: {number} finding{'' if number == 1 else 's'}"
    return JobResult(ExitCode.INVALID_INPUT, message, findings=findings)


@record
class PlannedJob:
    """A job of the plan and what is done with it.

    Attributes:
        name: the name of the job.
        course: the name of the course.
        track, aircraft: paths as users name them; the aircraft is None where nobody knows it.
        swept: the value of every sweep.
        job: None where the inputs are not even good enough to make one.
        reason: why it is flown, a clause; empty where it is not.
        known: how it stands without being flown; None where it is flown.
    """

    name: str
    course: str
    track: str
    aircraft: str | None
    swept: Combination
    job: Job | None
    reason: str = ""
    known: JobResult | None = None

    @property
    def action(self) -> str:
        """The action on the job: `fly`; `keep` what was finished before and stands; `refuse` invalid inputs."""
        if self.known is None:
            return "fly"
        return "refuse" if self.known.code == ExitCode.INVALID_INPUT else "keep"

    def as_object(self) -> dict[str, object]:
        """Return the step as plain values, for `--dry-run --json`."""
        return {
            "name": self.name,
            "course": self.course,
            "track": self.track,
            "aircraft": self.aircraft,
            "swept": dict(self.swept),
            "action": self.action,
            "reason": self.reason or (self.known.message if self.known and self.action == "refuse" else ""),
        }


@record
class BatchPlan:
    """The plan of a batch: all of its jobs, in order.

    Attributes:
        folder: where checkpoints and records lie.
        findings: what is wrong besides the jobs' own inputs.
        read: the files that it was made of, by their paths or names.
    """

    folder: Path
    steps: tuple[PlannedJob, ...]
    findings: tuple[Finding, ...] = ()
    read: tuple[str, ...] = ()

    def files(self) -> Iterator[Path]:
        """Yield the checkpoint and the record of every job."""
        for step in self.steps:
            yield checkpoint_path(self.folder, step.name)
            yield record_path(self.folder, step.name)


CHECKED_MAX = 300
"""The largest number of jobs that are checked."""

SWEPT = Place("--sweep", 0, 0)
"""The place that a finding names for a value that was swept on the command line."""

Findings = tuple[Finding, ...]


@record
class Family:
    """A family of jobs of one course and aircraft, which differ by the values of the sweeps.

    Attributes:
        sweeps: what they differ by.
        places: where keys are set or swept in a file, as far as they are.
        jobs: those to be checked.
    """

    sweeps: Sequence[Sweep]
    places: Mapping[str, Place]
    jobs: Sequence[Job]


def findings_of(job: Job, places: Mapping[str, Place]) -> Findings:
    """Return what is wrong with the inputs of a job.

    For a value that was swept, or set in a file, the finding names the place where that was done.
    """
    try:
        inputs_from_documents(job.track, job.aircraft, job.settings, job.overrides)
    except InputError as error:
        known = {**{key: SWEPT for key, _ in job.swept}, **places}
        return tuple(_placed(finding, known) for finding in error.findings)
    return ()


def refused_jobs(families: Sequence[Family]) -> Mapping[str, Findings]:
    """Return the findings of the jobs whose inputs are not valid, by the job's name."""
    chosen = [list(_chosen(family.sweeps, family.jobs)) for family in families]
    found: dict[str, Findings] = {}
    checked: list[set[Findings]] = [set() for _ in families]
    for index, job in islice(_in_turn(chosen), CHECKED_MAX):
        findings = findings_of(job, families[index].places)
        checked[index].add(findings)
        if findings:
            found[job.name] = findings
    for family, seen in zip(families, checked, strict=True):
        if len(seen) == 1 and (findings := next(iter(seen))):
            found.update({job.name: findings for job in family.jobs})
    return found


def _chosen(sweeps: Sequence[Sweep], jobs: Sequence[Job]) -> Iterator[Job]:
    """Yield the jobs in which every value occurs, as far as they are flown at all."""
    by_values = {job.swept: job for job in jobs}
    wanted = [by_values[values] for values in cover(sweeps) if values in by_values]
    yield from wanted or jobs[:1]


def _in_turn(chosen: Sequence[Sequence[Job]]) -> Iterator[tuple[int, Job]]:
    """Yield the first job of every family, then the second of each, and so on, with the number of the family."""
    for row in zip_longest(*chosen):
        yield from ((family, job) for family, job in enumerate(row) if job is not None)


def _placed(finding: Finding, places: Mapping[str, Place]) -> Finding:
    if finding.file != SET_OPTION:
        return finding
    above = f"{finding.key.rpartition('.')[0]}."  # a key that was set may have made what something is missing in
    within = [place for key, place in places.items() if finding.key == key or finding.key.startswith(f"{key}.")]
    beside = [place for key, place in places.items() if above != "." and key.startswith(above)]
    for place in (*within, *beside)[:1]:
        return replace(finding, file=place.file, line=place.line, column=place.column)
    return finding


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
