"""Jobs, plans and batches for the tests; courses are small and flown by `stand_in_job.py`."""

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from command import Ran, run

from airrace.files.inputs import Document
from airrace.runs.batch import BatchOptions
from airrace.runs.batch.jobs import Job
from airrace.runs.batch.local import LocalPool
from airrace.runs.batch.planning import (
    BatchPlan,
    JobResult,
    JobTemplate,
    PlannedJob,
    find_sources,
    make_plan,
    parse_sweeps,
)
from airrace.runs.batch.record import FileMark, JobRecord, Repeat, checkpoint_path, write_record
from airrace.runs.batch.supervision import AttemptResult, JobPool, StageFinished, Watcher, supervise

ROOT = Path(__file__).parents[3]
AIRCRAFT = ROOT / "configs" / "edge540.yaml"
STAND_IN = (sys.executable, "-S", str(Path(__file__).with_name("stand_in_job.py")))
VERSIONS = "airrace 0.1.0"


def write_course(folder: Path, name: str = "oval", *, notes: str = "") -> Path:
    """A course of two gates."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.yaml"
    path.write_text(
        f"""schema: airrace/track/1
name: {name}
notes: '{notes}'
aircraft: {AIRCRAFT}
rules: {{n_z_max: 10}}
gates:
  a: {{type: level, north_m: 0, east_m: 0, heading_deg: 0}}
  b: {{type: level, north_m: 500, east_m: 100, heading_deg: 30}}
course: {{start: a, lap: [b]}}
"""
    )
    return path


def job(name: str = "oval", **changed: object) -> Job:
    """A job that nobody has read from a file."""
    values: dict[str, object] = {
        "name": name,
        "course": name,
        "track": Document(f"{name}.yaml", "a track"),
        "aircraft": Document("aircraft.yaml", "an aircraft"),
        "settings": None,
        "overrides": (),
        "swept": (),
        "until": "point-mass",
        "versions": VERSIONS,
        **changed,
    }
    return Job(**values)  # type: ignore[arg-type]


def step(one: Job, *, result: JobResult | None = None, reason: str = "new") -> PlannedJob:
    return PlannedJob(one.name, one.course, one.track.path, one.aircraft.path, one.swept, one, reason, result)


def plan_of(folder: Path, *jobs: Job) -> BatchPlan:
    return BatchPlan(folder, tuple(step(one) for one in jobs))


def planned(
    *courses: str | Path,
    folder: Path,
    sweeps: Sequence[str] = (),
    versions: str = VERSIONS,
    until: str = "point-mass",
    repeat: Repeat = Repeat.NONE,
    **template: object,
) -> BatchPlan:
    """The plan of a call of the command."""
    options = JobTemplate(sweeps=parse_sweeps(sweeps), **template)  # type: ignore[arg-type]
    return make_plan(find_sources([*map(str, courses)], options), folder, until=until, versions=versions, repeat=repeat)


def policy(**options: object) -> BatchOptions:
    """Options of a batch."""
    return BatchOptions(courses=(), **options)  # type: ignore[arg-type]


def flown(
    plan: BatchPlan, options: BatchOptions | None = None, pool: JobPool | None = None, slots: int = 2
) -> list[JobResult]:
    """Fly a plan with stand-ins."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    with pool or LocalPool(STAND_IN, slots) as running:
        return list(supervise(plan, running, options or policy(), Watched()))


def starts(folder: Path, name: str) -> list[str]:
    """How each process of a job began: `new` or `resumed`."""
    path = folder / f"{name}.starts"
    return [line.split()[1] for line in path.read_text().splitlines()] if path.exists() else []


def finished(folder: Path, one: Job, code: int = 0, message: str = "") -> None:
    """Leave a job behind as if it had been flown."""
    folder.mkdir(parents=True, exist_ok=True)
    path = checkpoint_path(folder, one.name)
    path.write_bytes(b"whatever was flown")
    run = {"race_time_s": 10.0, "stages": []}
    write_record(folder, one.name, JobRecord(one.fingerprint, True, code, message, 1.0, (), run, (), FileMark.of(path)))


@dataclass
class Watched(Watcher):
    """Remembers what a watcher is told."""

    lines: list[str] = field(default_factory=list)

    def on_begin(self, plan: BatchPlan) -> None:
        self.lines.append(f"begun {len(plan.steps)}")

    def on_start(self, step: PlannedJob, attempt: int, where: str) -> None:
        self.lines.append(f"{step.name} started {attempt}")

    def on_stage_start(self, step: PlannedJob, stage: str) -> None:
        self.lines.append(f"{step.name} {stage} started")

    def on_stage_end(self, step: PlannedJob, event: StageFinished) -> None:
        self.lines.append(f"{step.name} {event.stage} {event.status}")

    def on_retry(self, step: PlannedJob, reason: str) -> None:
        self.lines.append(f"{step.name} again: {reason}")

    def on_end(self, step: PlannedJob, result: JobResult) -> None:
        self.lines.append(f"{step.name} ended {result.code}")


def ending(code: int = 0, race_time: float | None = 10.0, message: str = "") -> AttemptResult:
    """An answer."""
    return AttemptResult(code, message, 1.0, (), {"race_time_s": race_time, "stages": []})


PROGRAM = f"""
import airrace.runs.batch.local as process
process.JOB_COMMAND = {STAND_IN!r}
process.GRACE = 600.0  # whoever waits for its end waits longer than any test does
from airrace.__main__ import main
main()
"""


class Shell:
    """`airrace batch --until point-mass` in a folder of its own, with a course `oval.yaml` in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.out = folder / "batch"

    def __call__(self, *arguments: str | Path) -> Ran:
        return run("batch", "--until", "point-mass", *arguments)

    def start(self, *arguments: str | Path) -> subprocess.Popen[str]:
        """In a process of its own."""
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, "batch", "--until", "point-mass", *map(str, arguments)],
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
