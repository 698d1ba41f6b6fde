"""Planning of a batch: the courses that a user means, and every combination as a job, compared with what is done."""

import glob
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, zip_longest
from math import prod
from pathlib import Path
from typing import Any

from airrace.batch.jobs import (
    Combination,
    Job,
    Sweep,
    combinations,
    cover,
    job_name,
    parse_sweep,
    refuse_clashes,
    sweep_of,
)
from airrace.batch.record import Choice, JobRecord, checkpoint_path, reason_to_fly, record_path
from airrace.errors import Finding, InputError, UsageError
from airrace.inputs import inputs_from_documents, read_documents
from airrace.inputs.document import AIRCRAFT, TRACKS, Document, read_document
from airrace.inputs.nodes import MappingNode, Place, Reporter
from airrace.inputs.overrides import FILE as SET_OPTION
from airrace.inputs.overrides import value_text
from airrace.inputs.schema import read_entry
from airrace.inputs.settings import BatchEntry
from airrace.runs.command_result import ExitCode
from airrace.runs.output import ensure_free
from airrace.standard_streams import STANDARD, name_of


@dataclass(frozen=True)
class PlanningLimits:
    """The sizes of what is planned.

    Attributes:
        folders_max: the largest number of folders that one pattern is looked for in; a tenth of a second's work
            on most disks.
        matches_max: the largest number of files that one pattern may mean; each of them is read before any job
            runs.
        jobs_max: the largest number of jobs of a batch.
        checked_max: the largest number of jobs that are checked.
    """

    folders_max: int = 10_000
    matches_max: int = 20_000
    jobs_max: int = 100_000
    checked_max: int = 300


LIMITS = PlanningLimits()


class TooWideError(Exception):
    """An error of a pattern that would be looked for in too many places, in words."""


def matching(pattern: str) -> list[str]:
    """Return the files that match a pattern, sorted by name.

    Raises:
        TooWideError: too many folders or files would have to be looked at.
    """
    found = list(islice((name for name in _expand(pattern) if not os.path.isdir(name)), LIMITS.matches_max + 1))
    if len(found) > LIMITS.matches_max:
        raise TooWideError(f"matches more than {LIMITS.matches_max} files; name fewer of them")
    return sorted(found)


def _expand(pattern: str) -> Iterator[str]:
    parts = Path(pattern).parts
    if "**" not in parts:
        yield from glob.iglob(pattern)
        return
    place = parts.index("**")
    above, below = parts[:place], parts[place + 1 :]
    names = below or ("*",)
    for folder in _folders(os.path.join(*above) if above else ""):
        yield from _expand(os.path.join(glob.escape(folder), *names))


def _folders(pattern: str) -> Iterator[str]:
    """Yield the folders that match and all within them, but for hidden ones and those that only links lead to."""
    looked_at = 0
    for top in glob.iglob(pattern) if pattern else [""]:
        for folder, within, _ in os.walk(top or os.curdir, followlinks=False):
            looked_at += 1
            if looked_at > LIMITS.folders_max:
                raise TooWideError(f"leads through more than {LIMITS.folders_max} folders; name one further down")
            within[:] = sorted(name for name in within if not name.startswith("."))
            yield folder if top else os.path.relpath(folder).removeprefix(os.curdir)


SWEEP_OPTION = "--sweep"


@dataclass(frozen=True)
class Manner:
    """The settings with which courses are solved.

    Attributes:
        aircraft: files, each of which flies every course; empty for the tracks' own.
        settings: a settings file, None for the defaults.
        overrides: `key=value` texts for all jobs.
        sweeps: values tried in turn.
        until: name of the last stage, None where nobody names one.
        places: where keys are set or swept in a file, for what is found to be wrong with them.
    """

    aircraft: tuple[Path, ...] = ()
    settings: Path | None = None
    overrides: tuple[str, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    until: str | None = None
    places: Mapping[str, Place] = field(default_factory=dict[str, Place])


@dataclass(frozen=True)
class SourceGroup:
    """A group of courses with the same settings."""

    courses: tuple[Path, ...]
    manner: Manner


@dataclass(frozen=True)
class Sources:
    """The groups of courses that were meant, what is wrong with the way they were named, and the batch files."""

    groups: tuple[SourceGroup, ...]
    findings: tuple[Finding, ...] = ()
    files: tuple[Path, ...] = ()


def parse_sweeps(texts: Sequence[str]) -> tuple[Sweep, ...]:
    """Return the sweeps of the command line.

    Raises:
        InputError: the inputs are not valid; it carries all findings.
    """
    findings: list[Finding] = []
    sweeps: dict[str, Sweep] = {}
    for text in texts:
        key = text.partition("=")[0].strip()
        try:
            sweep = parse_sweep(text)
        except ValueError as error:
            findings.append(Finding(SWEEP_OPTION, 0, 0, key, str(error)))
            continue
        if sweep.key in sweeps:
            findings.append(Finding(SWEEP_OPTION, 0, 0, key, "is swept twice; give all its values at once"))
        sweeps[sweep.key] = sweep
    if findings:
        raise InputError(findings)
    return tuple(sweeps.values())


def find_sources(named: Sequence[str], manner: Manner) -> Sources:
    """Return the courses named by files and patterns, and those of batch files.

    The manner of the command line comes first: it replaces the aircraft, the settings, the last stage and the sweeps of
    the same key in batch files, and its overrides come after theirs.
    """
    findings: list[Finding] = []
    courses: list[Path] = []
    groups: list[SourceGroup] = []
    files: list[Path] = []
    for path in _files(named, Path(), None, findings):
        document = _batch_document(path)
        if document is None and path == STANDARD:
            findings.append(Finding(name_of(path), 0, 0, "", "is no batch file, and courses are named"))
            continue
        if document is None:
            courses.append(path)
            continue
        files.append(path)
        try:
            entry, reporter = read_entry(BatchEntry, document)
            groups.append(_group_of(entry, reporter, path.parent, manner))
            findings += reporter.findings
        except InputError as error:
            findings += error.findings
    if courses:
        groups.insert(0, SourceGroup(tuple(courses), manner))
    return Sources(tuple(groups), tuple(findings), tuple(files))


def _batch_document(path: Path) -> Document | None:
    """Return the file at a path if it is a batch, else None.

    Whatever else is wrong with the file is reported when it is read as a course.
    """
    document = read_document(path, []) if path == STANDARD or os.path.isfile(path) else None
    said = None if document is None else re.search(r"^schema:\s*[\"']?airrace/batch/", document.text, re.MULTILINE)
    return document if said else None


def _group_of(entry: BatchEntry, reporter: Reporter, folder: Path, manner: Manner) -> SourceGroup:
    findings: list[Finding] = []
    courses: list[Path] = []
    for path in list(_files(entry.courses, folder, reporter, findings)):
        if _batch_document(path) is None:
            courses.append(path)
        else:
            reporter.value(("courses",), f"{path} is a batch and no course; name the courses that it names")
    reporter.findings.extend(findings)
    sweeps: dict[str, Sweep] = {}
    for key, values in entry.sweep.items():
        items = values.split(",") if isinstance(values, str) else [value_text(value) for value in values]
        try:
            sweeps[key] = sweep_of(key, items)
        except ValueError as error:
            reporter.value(("sweep", key), str(error))
    of_command_line = {sweep.key: sweep for sweep in manner.sweeps}
    places: dict[str, Place] = {}
    for part in ("set", "sweep"):
        node = reporter.find((part,))
        if isinstance(node, MappingNode):
            places |= {key: one.key_place for key, one in node.entries.items() if key not in of_command_line}
    return SourceGroup(
        tuple(courses),
        Manner(
            aircraft=manner.aircraft or tuple(AIRCRAFT.meant(Path(name), folder) for name in entry.aircraft or ()),
            settings=manner.settings or (None if entry.settings is None else folder / entry.settings),
            overrides=(*(f"{key}={value_text(value)}" for key, value in entry.set.items()), *manner.overrides),
            sweeps=tuple({**sweeps, **of_command_line}.values()),
            until=manner.until or entry.until,
            places=places,
        ),
    )


def _files(named: Sequence[str], folder: Path, reporter: Reporter | None, findings: list[Finding]) -> Iterator[Path]:
    """Yield the files of names and patterns, in their order; those of a pattern by name.

    What is wrong with a name is reported where a batch file has it, else among the findings.
    """
    for index, name in enumerate(named):
        path, file = folder / name, Path(name)
        if not glob.has_magic(name) or path.exists():
            if path.is_dir():
                findings.append(Finding(str(path), 0, 0, "", f"is a folder; name the files in it, e.g. {path}/*.yaml"))
            elif TRACKS.finds(file, folder):
                yield TRACKS.meant(file, folder)
            elif reporter is not None and not path.exists():
                reporter.value(("courses", index), TRACKS.missing(file, folder))
            else:  # a missing course becomes a job with invalid input
                yield path
            continue
        try:
            matches = matching(str(path))
            of_batch, alone = ("", "") if matches else (f"no file matches {path}", "no file matches this pattern")
        except TooWideError as error:
            matches, of_batch, alone = [], f"{path} {error}", str(error)
        yield from map(Path, matches)
        if alone and reporter is not None:
            reporter.value(("courses", index), of_batch)
        elif alone:
            findings.append(Finding(str(path), 0, 0, "", alone))


Findings = tuple[Finding, ...]


@dataclass(frozen=True)
class RouteSummary:
    """The routes that a job has tried, in short.

    Attributes:
        route: of the flight, in words.
        tried: how many there were, this one among them.
        next: the fastest of the others, in words; empty where there is none.
        behind: the time by which that one is behind on the rough mesh, s; None if there is none.
    """

    route: str
    tried: int
    next: str = ""
    behind: float | None = None


@dataclass(frozen=True)
class JobResult:
    """The end of a job in short, for there may be thousands.

    Attributes:
        code: the exit code that `airrace optimize` would have ended with.
        message: what went wrong; empty if nothing did.
        race_time: the race time of the last stage, s; None without a flight.
        wall: the wall time of the attempt that ended it, s.
        retries: why earlier attempts did not end it.
        findings: what is wrong with the inputs.
        routes: which route the flight takes; None where no other was tried.
        stage: the last one that is finished; empty where none is.
        laps: lap times of that stage, s; empty for a race of one lap.
        least_distances: of its flight from everything on the course, m, by what it is, e.g. `pylon g3`.
    """

    code: int
    message: str = ""
    race_time: float | None = None
    wall: float = 0.0
    retries: tuple[str, ...] = ()
    findings: Findings = ()
    routes: RouteSummary | None = None
    stage: str = ""
    laps: tuple[float, ...] = ()
    least_distances: tuple[tuple[str, float], ...] = ()


def result_of(record: JobRecord) -> JobResult:
    """Return what a record says."""
    run: Mapping[str, Any] = record.run or {}  # Any: the object of `airrace optimize --json`
    stages: Sequence[Mapping[str, Any]] = run.get("stages") or ({},)
    routes = next((found for stage in stages if (found := stage.get("routes"))), None)
    least: Sequence[Mapping[str, Any]] = stages[-1].get("least_distances") or ()
    summary = None
    if routes:
        rival = (routes[1]["route"], routes[1]["difference_s"]) if len(routes) > 1 else ()
        summary = RouteSummary(routes[0]["route"], len(routes), *rival)
    return JobResult(
        record.code,
        record.message,
        run.get("race_time_s"),
        record.wall,
        record.retries,
        record.findings,
        summary,
        stages[-1].get("stage", ""),
        tuple(stages[-1].get("lap_times_s", ())),
        tuple((f"{one['kind']} {one['name']}".rstrip(), one["distance_m"]) for one in least),
    )


def invalid(findings: Findings) -> JobResult:
    """Return the result of a job whose inputs are not valid."""
    number = len(findings)
    message = f"the input is not valid: {number} finding{'' if number == 1 else 's'}"
    return JobResult(ExitCode.INVALID_INPUT, message, findings=findings)


@dataclass(frozen=True)
class PlannedJob:
    """A job of the plan and what is done with it.

    Attributes:
        name: the name of the job.
        course: the name of the course.
        track, aircraft: paths as users name them; the aircraft is None where nobody knows it.
        swept: the value of every sweep.
        job: None where the inputs are not even good enough to make one.
        reason: why it runs, a clause; empty where it is not.
        known: how it stands without a run; None where it runs.
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


@dataclass(frozen=True)
class BatchPlan:
    """The plan of a batch: all of its jobs, in order.

    Attributes:
        folder: where checkpoints and records lie.
        findings: what is wrong besides the jobs' own inputs.
        read: the files that it was made of, by their paths or names.
    """

    folder: Path
    steps: tuple[PlannedJob, ...]
    findings: Findings = ()
    read: tuple[str, ...] = ()

    def files(self) -> Iterator[Path]:
        """Yield the checkpoint and the record of every job."""
        for step in self.steps:
            yield checkpoint_path(self.folder, step.name)
            yield record_path(self.folder, step.name)


def make_plan(sources: Sources, folder: Path, *, until: str, versions: str, choice: Choice = Choice.NONE) -> BatchPlan:
    """Return the plan of a batch: everything that is found out before any job runs.

    Args:
        until: the last stage where nobody names one.
        versions: the versions of airrace and of what its numbers depend on.
        choice: which finished jobs are repeated.

    Raises:
        InputError: a settings file cannot be read, or a value is both set and swept.
        UsageError: two jobs would write the same file or one that is read, or there are too many.
    """
    total = sum(
        len(group.courses) * max(1, len(group.manner.aircraft)) * prod(len(one.values) for one in group.manner.sweeps)
        for group in sources.groups
    )
    if total > LIMITS.jobs_max:
        raise UsageError(f"these are {total} jobs; at most {LIMITS.jobs_max} are allowed in a batch")
    planner = _Planner(until, versions)
    families = [family for group in sources.groups for family in planner.families(group)]
    refuse_clashes((step.name, _origin(step)) for _, steps in families for step in steps)
    families = [(manner, [_compare(step, folder, choice) for step in steps]) for manner, steps in families]
    refused = refused_jobs(
        [
            (manner, jobs)
            for manner, steps in families
            if (jobs := [one.job for one in steps if one.job and not one.known])
        ]
    )
    steps = tuple(
        replace(step, reason="", known=invalid(findings)) if (findings := refused.get(step.name)) else step
        for _, family in families
        for step in family
    )
    read = [file for step in steps for file in (step.track, step.aircraft) if file is not None]
    read += [str(file) for file in (*sources.files, *(one.manner.settings for one in sources.groups)) if file]
    plan = BatchPlan(folder, steps, sources.findings, tuple(dict.fromkeys(read)))
    ensure_free(*plan.files(), force=True, sources=plan.read, made=folder)
    return plan


class _Planner:
    """A maker of jobs that keeps every text once."""

    def __init__(self, until: str, versions: str) -> None:
        self._until = until
        self._versions = versions
        self._documents: dict[Document, Document] = {}

    def families(self, group: SourceGroup) -> Iterator[tuple[Manner, list[PlannedJob]]]:
        """Yield the jobs of each course and aircraft, which differ by the values of the sweeps alone."""
        manner = group.manner
        set_keys = {text.partition("=")[0].strip() for text in manner.overrides}
        both = [sweep.key for sweep in manner.sweeps if sweep.key in set_keys]
        if both:
            message = "is swept, and set as well; do one of them"
            raise InputError([Finding(SWEEP_OPTION, 0, 0, key, message) for key in both])
        settings = None
        if manner.settings is not None:
            findings: list[Finding] = []
            settings = read_document(manner.settings, findings)
            if settings is None:
                raise InputError(findings)
            settings = self._documents.setdefault(settings, settings)
        for course in group.courses:
            for aircraft in manner.aircraft or (None,):
                try:
                    jobs = list(self._jobs(course, aircraft, settings, manner))
                except InputError as error:
                    name, path = job_name(course, aircraft, ()), None if aircraft is None else str(aircraft)
                    known = invalid(tuple(error.findings))
                    steps = [PlannedJob(name, course.stem, str(course), path, (), None, known=known)]
                else:
                    steps = [
                        PlannedJob(job.name, job.course, job.track.path, job.aircraft.path, job.swept, job)
                        for job in jobs
                    ]
                yield manner, steps

    def _jobs(self, course: Path, aircraft: Path | None, settings: Document | None, manner: Manner) -> Iterator[Job]:
        """Yield one job for every combination of swept values.

        Raises:
            InputError: the track or the aircraft cannot be read.
        """
        read: dict[tuple[str, ...], tuple[Document, Document]] = {}
        for swept in combinations(manner.sweeps):
            overrides = (*manner.overrides, *(f"{key}={value}" for key, value in swept))
            naming = tuple(one for one in overrides if one.partition("=")[0].strip() == "aircraft")
            if naming not in read:
                read[naming] = read_documents(course, aircraft=aircraft, overrides=naming)
            track, craft = (self._documents.setdefault(one, one) for one in read[naming])
            name, until = job_name(course, aircraft, swept), manner.until or self._until
            yield Job(name, course.stem, track, craft, settings, overrides, swept, until, self._versions)


def _origin(step: PlannedJob) -> str:
    """Return what a job is made of, in the user's words."""
    aircraft = [] if step.aircraft is None else [f"(with {step.aircraft})"]
    swept = [f"({', '.join(f'{key}={value}' for key, value in step.swept)})"] if step.swept else []
    return " ".join([step.track, *aircraft, *swept])


def _compare(step: PlannedJob, folder: Path, choice: Choice) -> PlannedJob:
    """Return a job with the reason to fly it, or with its result where it is finished."""
    if step.job is None:
        return step
    reason, record = reason_to_fly(step.job, folder, choice)
    return replace(step, reason=reason, known=result_of(record) if record and not reason else None)


def refused_jobs(families: Sequence[tuple[Manner, Sequence[Job]]]) -> Mapping[str, Findings]:
    """Return the findings of the jobs whose inputs are not valid, by the job's name.

    Of each family those are checked, in turn, in which every swept value occurs; where all of them have the same fault,
    the whole family has it.
    """
    chosen: list[Sequence[Job]] = []
    for manner, jobs in families:
        by_values = {job.swept: job for job in jobs}
        chosen.append([by_values[values] for values in cover(manner.sweeps) if values in by_values] or jobs[:1])
    found: dict[str, Findings] = {}
    checked: list[set[Findings]] = [set() for _ in families]
    in_turn = ((number, job) for jobs in zip_longest(*chosen) for number, job in enumerate(jobs) if job is not None)
    for number, job in islice(in_turn, LIMITS.checked_max):
        findings = findings_of(job, families[number][0].places)
        checked[number].add(findings)
        if findings:
            found[job.name] = findings
    for (_, jobs), faults in zip(families, checked, strict=True):
        if len(faults) == 1 and (findings := next(iter(faults))):
            found.update(dict.fromkeys((job.name for job in jobs), findings))
    return found


def findings_of(job: Job, places: Mapping[str, Place]) -> Findings:
    """Return what is wrong with the inputs of a job.

    For a value that was swept, or set in a file, the finding names the place where that was done.
    """
    try:
        inputs_from_documents(job.track, job.aircraft, job.settings, job.overrides)
    except InputError as error:
        known = {**{key: Place(SWEEP_OPTION, 0, 0) for key, _ in job.swept}, **places}
        return tuple(_at_its_place(finding, known) for finding in error.findings)
    return ()


def _at_its_place(finding: Finding, places: Mapping[str, Place]) -> Finding:
    if finding.file != SET_OPTION:
        return finding
    above = f"{finding.key.rpartition('.')[0]}."  # a key that was set may have made what something is missing in
    within = [place for key, place in places.items() if finding.key == key or finding.key.startswith(f"{key}.")]
    beside = [place for key, place in places.items() if above != "." and key.startswith(above)]
    for place in (*within, *beside)[:1]:
        return replace(finding, file=place.file, line=place.line, column=place.column)
    return finding
