"""A check of the jobs' inputs before anything is flown, without reading thousands of them in full.

Of every course as many combinations are read as it takes for each value of each sweep to occur. If all of them are
wrong in the same way, so are the others. What is not looked at here, or wrong in some combination only, the job tells.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, zip_longest

from airrace.batch.job import Job
from airrace.batch.sweep import Sweep, cover
from airrace.errors import Finding, InputError
from airrace.inputs import inputs_from_documents
from airrace.inputs.nodes import Place
from airrace.inputs.overrides import FILE as SET_OPTION
from airrace.records import record

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
