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

from airrace.errors import Finding, InputError, UsageError
from airrace.files.inputs import inputs_from_documents, read_documents
from airrace.files.inputs.document import AIRCRAFT, TRACKS, Document, read_document
from airrace.files.inputs.nodes import MappingNode, Place, Reporter
from airrace.files.inputs.overrides import FILE as SET_OPTION
from airrace.files.inputs.overrides import value_text
from airrace.files.inputs.schema import read_entry
from airrace.files.inputs.settings import BatchEntry
from airrace.runs.batch.jobs import (
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
from airrace.runs.batch.record import JobRecord, Repeat, checkpoint_path, reason_to_fly, record_path
from airrace.runs.command_result import ExitCode
from airrace.runs.output import ensure_free
from airrace.runtime.standard_streams import STANDARD, name_of

JOBS_MAX = 100_000
"""The largest number of jobs of a batch."""
CHECKED_MAX = 300
"""The largest number of jobs whose inputs are checked before any of them runs."""
SWEEP_OPTION = "--sweep"


@dataclass(frozen=True)
class JobTemplate:
    """The options with which courses are solved.

    Attributes:
        aircraft: files, each of which flies every course; empty for the tracks' own.
        settings: a settings file, None for the defaults.
        overrides: `key=value` texts for all jobs.
        sweeps: values tried in turn.
        until: name of the last stage, None where none is named.
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
    """A group of courses with the same options."""

    courses: tuple[Path, ...]
    template: JobTemplate


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


def find_sources(names: Sequence[str], template: JobTemplate) -> Sources:
    """Return the courses named by files and patterns, and those of batch files.

    The template of the command line comes first: it replaces the aircraft, the settings, the last stage and the sweeps
    of the same key in batch files, and its overrides come after theirs.
    """
    findings: list[Finding] = []
    courses: list[Path] = []
    groups: list[SourceGroup] = []
    files: list[Path] = []
    for name in names:
        paths, fault = _find_files(name, Path())
        if fault:
            findings.append(Finding(name, 0, 0, "", fault))
        for path in paths:
            document = _batch_document(path)
            if document is not None:
                files.append(path)
                try:
                    entry, reporter = read_entry(BatchEntry, document)
                    groups.append(_group_of(entry, reporter, path.parent, template))
                    findings += reporter.findings
                except InputError as error:
                    findings += error.findings
            elif path == STANDARD:
                findings.append(Finding(name_of(path), 0, 0, "", "is no batch file, and courses are named"))
            else:  # a missing course becomes a job with invalid input
                courses.append(path)
    if courses:
        groups.insert(0, SourceGroup(tuple(courses), template))
    return Sources(tuple(groups), tuple(findings), tuple(files))


def _find_files(name: str, folder: Path) -> tuple[list[Path], str]:
    """Return the files that a name or a pattern in a folder stands for, sorted, and what is wrong with it."""
    path = folder / name
    if glob.has_magic(name) and not path.exists():
        matches = [Path(match) for match in sorted(glob.glob(str(path), recursive=True)) if not os.path.isdir(match)]
        return matches, "" if matches else "no file matches this pattern"
    if path.is_dir():
        return [], f"is a folder; name the files in it, e.g. {path}/*.yaml"
    return [TRACKS.label(Path(name), folder) if TRACKS.finds(Path(name), folder) else path], ""


def _batch_document(path: Path) -> Document | None:
    """Return the file at a path if it is a batch, else None.

    Whatever else is wrong with the file is reported when it is read as a course.
    """
    document = read_document(path, []) if path == STANDARD or os.path.isfile(path) else None
    if document and re.search(r"^schema:\s*[\"']?airrace/batch/", document.text, re.MULTILINE):
        return document
    return None


def _group_of(entry: BatchEntry, reporter: Reporter, folder: Path, template: JobTemplate) -> SourceGroup:
    """Return the courses of a batch file; what is wrong with them is reported where the file names them."""
    courses: list[Path] = []
    for index, name in enumerate(entry.courses):
        paths, fault = _find_files(name, folder)
        if fault:
            reporter.value(("courses", index), f"{folder / name}: {fault}")
        for path in paths:
            if _batch_document(path) is not None:
                message = f"{path} is a batch and no course; name the courses that it names"
                reporter.value(("courses", index), message)
            elif not TRACKS.finds(path) and not path.exists():
                reporter.value(("courses", index), TRACKS.missing(Path(name), folder))
            else:
                courses.append(path)
    sweeps: dict[str, Sweep] = {}
    for key, values in entry.sweep.items():
        items = values.split(",") if isinstance(values, str) else [value_text(value) for value in values]
        try:
            sweeps[key] = sweep_of(key, items)
        except ValueError as error:
            reporter.value(("sweep", key), str(error))
    of_command_line = {sweep.key: sweep for sweep in template.sweeps}
    places: dict[str, Place] = {}
    for part in ("set", "sweep"):
        node = reporter.find((part,))
        if isinstance(node, MappingNode):
            places |= {key: value.key_place for key, value in node.entries.items() if key not in of_command_line}
    of_file = JobTemplate(
        aircraft=template.aircraft or tuple(AIRCRAFT.label(Path(name), folder) for name in entry.aircraft or ()),
        settings=template.settings or (None if entry.settings is None else folder / entry.settings),
        overrides=(*(f"{key}={value_text(value)}" for key, value in entry.set.items()), *template.overrides),
        sweeps=tuple({**sweeps, **of_command_line}.values()),
        until=template.until or entry.until,
        places=places,
    )
    return SourceGroup(tuple(courses), of_file)


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
    routes: RouteSummary | None = None
    for stage in reversed(stages):
        if tried := stage.get("routes"):
            second = (tried[1]["route"], tried[1]["difference_s"]) if len(tried) > 1 else ()
            routes = RouteSummary(tried[0]["route"], len(tried), *second)
    least: Sequence[Mapping[str, Any]] = stages[-1].get("least_distances") or ()
    return JobResult(
        record.code,
        record.message,
        run.get("race_time_s"),
        record.wall,
        record.retries,
        record.findings,
        routes,
        stages[-1].get("stage", ""),
        tuple(stages[-1].get("lap_times_s", ())),
        tuple((f"{place['kind']} {place['name']}".rstrip(), place["distance_m"]) for place in least),
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
        track, aircraft: paths as users name them; the aircraft is None where it is unknown.
        swept: the value of every sweep.
        job: None where the inputs are not even good enough to make one.
        reason: why it runs, a clause; empty where it is not.
        result: how it stands without a run; None where it runs.
    """

    name: str
    course: str
    track: str
    aircraft: str | None
    swept: Combination
    job: Job | None
    reason: str = ""
    result: JobResult | None = None

    @property
    def action(self) -> str:
        """The action on the job: `fly`; `keep` what was finished before and stands; `refuse` invalid inputs."""
        if self.result is None:
            return "fly"
        return "refuse" if self.result.code == ExitCode.INVALID_INPUT else "keep"

    def as_object(self) -> dict[str, object]:
        """Return the step as plain values, for `--dry-run --json`."""
        return {
            "name": self.name,
            "course": self.course,
            "track": self.track,
            "aircraft": self.aircraft,
            "swept": dict(self.swept),
            "action": self.action,
            "reason": self.reason or (self.result.message if self.result and self.action == "refuse" else ""),
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


def make_plan(sources: Sources, folder: Path, *, until: str, versions: str, repeat: Repeat = Repeat.NONE) -> BatchPlan:
    """Return the plan of a batch: everything that is found out before any job runs.

    Args:
        until: the last stage where none is named.
        versions: the versions of airrace and of what its numbers depend on.
        repeat: which finished jobs are repeated.

    Raises:
        InputError: a settings file cannot be read, or a value is both set and swept.
        UsageError: two jobs would write the same file or one that is read, or there are too many.
    """
    total = 0
    for group in sources.groups:
        template = group.template
        runs = len(group.courses) * max(1, len(template.aircraft))
        total += runs * prod(len(sweep.values) for sweep in template.sweeps)
    if total > JOBS_MAX:
        raise UsageError(f"these are {total} jobs; at most {JOBS_MAX} are allowed in a batch")
    families: list[tuple[JobTemplate, list[PlannedJob]]] = []
    for group in sources.groups:
        template, last = group.template, group.template.until or until
        settings = _read_settings(template)
        for course in group.courses:
            for aircraft in template.aircraft or (None,):
                families.append((template, _plan_family(course, aircraft, settings, template, last, versions)))
    refuse_clashes((step.name, _origin(step)) for _, steps in families for step in steps)
    families = [(template, [_compare(step, folder, repeat) for step in steps]) for template, steps in families]
    faults = find_faults(families)
    steps: list[PlannedJob] = []
    for _, family in families:
        for step in family:
            findings = faults.get(step.name)
            steps.append(replace(step, reason="", result=invalid(findings)) if findings else step)
    read = [file for step in steps for file in (step.track, step.aircraft) if file is not None]
    read += [str(file) for file in (*sources.files, *(group.template.settings for group in sources.groups)) if file]
    plan = BatchPlan(folder, tuple(steps), sources.findings, tuple(dict.fromkeys(read)))
    ensure_free(*plan.files(), force=True, sources=plan.read, made=folder)
    return plan


def _read_settings(template: JobTemplate) -> Document | None:
    """Return the settings file, and refuse values that are both set and swept."""
    set_keys = {text.partition("=")[0].strip() for text in template.overrides}
    message = "is swept, and set as well; do one of them"
    findings = [Finding(SWEEP_OPTION, 0, 0, sweep.key, message) for sweep in template.sweeps if sweep.key in set_keys]
    settings = None if template.settings is None else read_document(template.settings, findings)
    if findings:
        raise InputError(findings)
    return settings


def _plan_family(
    course: Path, aircraft: Path | None, settings: Document | None, template: JobTemplate, until: str, versions: str
) -> list[PlannedJob]:
    """Return the jobs of a course and an aircraft, one for every combination of swept values."""
    steps: list[PlannedJob] = []
    documents: dict[tuple[str, ...], tuple[Document, Document]] = {}  # by what names the aircraft
    try:
        for swept in combinations(template.sweeps):
            overrides = (*template.overrides, *(f"{key}={value}" for key, value in swept))
            naming = tuple(text for text in overrides if text.partition("=")[0].strip() == "aircraft")
            if naming not in documents:
                documents[naming] = read_documents(course, aircraft=aircraft, overrides=naming)
            track, craft = documents[naming]
            name = job_name(course, aircraft, swept)
            job = Job(name, course.stem, track, craft, settings, overrides, swept, until, versions)
            steps.append(PlannedJob(name, course.stem, track.path, craft.path, swept, job))
    except InputError as error:
        path = None if aircraft is None else str(aircraft)
        name, result = job_name(course, aircraft, ()), invalid(tuple(error.findings))
        return [PlannedJob(name, course.stem, str(course), path, (), None, result=result)]
    return steps


def _origin(step: PlannedJob) -> str:
    """Return what a job is made of, in the user's words."""
    text = step.track
    if step.aircraft is not None:
        text += f" (with {step.aircraft})"
    if step.swept:
        text += f" ({', '.join(f'{key}={value}' for key, value in step.swept)})"
    return text


def _compare(step: PlannedJob, folder: Path, repeat: Repeat) -> PlannedJob:
    """Return a job with the reason to fly it, or with its result where it is finished."""
    if step.job is None:
        return step
    reason, record = reason_to_fly(step.job, folder, repeat)
    return replace(step, reason=reason, result=result_of(record) if record and not reason else None)


def find_faults(families: Sequence[tuple[JobTemplate, Sequence[PlannedJob]]]) -> Mapping[str, Findings]:
    """Return the findings of the jobs whose inputs are not valid, by the job's name.

    Of each family those are checked, in turn, in which every swept value occurs; where all of them have the same fault,
    the whole family has it.
    """
    faults: dict[str, Findings] = {}
    families_jobs = [[step.job for step in steps if step.job and not step.result] for _, steps in families]
    samples: list[Sequence[Job]] = []
    for (template, _), jobs in zip(families, families_jobs, strict=True):
        by_values = {job.swept: job for job in jobs}
        samples.append([by_values[values] for values in cover(template.sweeps) if values in by_values] or jobs[:1])
    kinds: list[set[Findings]] = [set() for _ in families]
    in_turn = ((number, job) for jobs in zip_longest(*samples) for number, job in enumerate(jobs) if job is not None)
    for number, job in islice(in_turn, CHECKED_MAX):
        findings = findings_of(job, families[number][0].places)
        kinds[number].add(findings)
        if findings:
            faults[job.name] = findings
    for jobs, kind in zip(families_jobs, kinds, strict=True):
        if len(kind) == 1 and (findings := next(iter(kind))):
            faults.update(dict.fromkeys((job.name for job in jobs), findings))
    return faults


def findings_of(job: Job, places: Mapping[str, Place]) -> Findings:
    """Return what is wrong with the inputs of a job.

    For a value that was swept, or set in a file, the finding names the place where that was done.
    """
    try:
        inputs_from_documents(job.track, job.aircraft, job.settings, job.overrides)
    except InputError as error:
        origins = {**{key: Place(SWEEP_OPTION, 0, 0) for key, _ in job.swept}, **places}
        return tuple(_at_its_place(finding, origins) for finding in error.findings)
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
