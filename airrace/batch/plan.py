"""The route on which a job was flown, and the one that came next."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from airrace.batch.job import Job
from airrace.batch.record import JobRecord, checkpoint_path, record_path
from airrace.batch.sweep import Combination
from airrace.errors import Finding
from airrace.records import record
from airrace.runs.command_result import ExitCode


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
