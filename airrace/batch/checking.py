"""Whether the inputs of jobs are valid, found out before anything is flown, without reading thousands of them in full.

Of every course as many combinations are read as it takes for each value of each sweep to occur. If all of them are
wrong in the same way, so are the others. What is not looked at here, or wrong in some combination only, the job tells.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest

from airrace.batch.job import Job
from airrace.batch.sweep import Sweep, cover
from airrace.documents import inputs_from_documents
from airrace.documents.overrides import FILE as SET_OPTION
from airrace.errors import Finding, InputError

CHECKED_MAX = 300
"""So many jobs are checked at most."""

Findings = tuple[Finding, ...]


def findings_of(job: Job) -> Findings:
    """What is wrong with the inputs of a job; a value that was swept is told as such."""
    try:
        inputs_from_documents(job.track, job.aircraft, job.settings, job.overrides)
    except InputError as error:
        swept = {key for key, _ in job.swept}
        return tuple(
            replace(one, file="--sweep") if one.file == SET_OPTION and _within(one.key, swept) else one
            for one in error.findings
        )
    return ()


def refused_jobs(families: Sequence[tuple[Sequence[Sweep], Sequence[Job]]]) -> Mapping[str, Findings]:
    """Findings by name, of the jobs whose inputs are not valid.

    Args:
        families: the jobs of one course and aircraft each, that differ by the values of the sweeps.
    """
    chosen = [list(_chosen(sweeps, jobs)) for sweeps, jobs in families]
    found: dict[str, Findings] = {}
    checked: list[set[Findings]] = [set() for _ in families]
    for number, (family, job) in enumerate(_in_turn(chosen)):
        if number == CHECKED_MAX:
            break
        findings = findings_of(job)
        checked[family].add(findings)
        if findings:
            found[job.name] = findings
    for (_, jobs), seen in zip(families, checked, strict=True):
        if len(seen) == 1 and (findings := next(iter(seen))):
            found.update({job.name: findings for job in jobs})
    return found


def _chosen(sweeps: Sequence[Sweep], jobs: Sequence[Job]) -> Iterator[Job]:
    """The jobs in which every value occurs; of those that are flown at all."""
    by_values = {job.swept: job for job in jobs}
    wanted = [by_values[values] for values in cover(sweeps) if values in by_values]
    yield from wanted or jobs[:1]


def _in_turn(chosen: Sequence[Sequence[Job]]) -> Iterator[tuple[int, Job]]:
    """The first job of every family, then the second of each, and so on."""
    for row in zip_longest(*chosen):
        yield from ((family, job) for family, job in enumerate(row) if job is not None)


def _within(key: str, swept: set[str]) -> bool:
    return any(key == one or key.startswith(f"{one}.") for one in swept)
