"""The flights of a study: what is flown, on which course, and where the results are kept.

Every job is a process of its own (`study_flight.py`), so that nothing that happens in it can end the study. Results are
JSON lines in a file; what stands there is not flown again, so that a study that was interrupted goes on where it was.
"""

import dataclasses
import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from random_courses import random_course

from airrace.inputs import Inputs, load_inputs
from airrace.procedure.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = tuple(sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml")))
FLIGHT = ROOT / "scripts" / "study_flight.py"
CERTIFIED = "certified"
OFF = "off"
AGAIN = ("refused", "out of time", "died")  # outcomes that are not kept: another try may end otherwise
RUNNING: "set[subprocess.Popen[str]]" = set()
GRACE = 20.0  # s, that a job which is told to stop may take

Record = dict[str, Any]  # Any: what JSON holds


@dataclass(frozen=True)
class Job:
    """One flight, or some random starts.

    Attributes:
        course: a shipped course by name, `seed 7` for a generated one, or a track file.
        overrides: `key=value`, as of `airrace optimize --set`.
        search: value of `settings.search`; empty leaves it at its default.
        change: name of a transformation in `study_flight.py`; empty for none.
        starts: numbers of random starts to be solved roughly; no flight then.
        refine: number of the random start from which the flight is optimised and proved; None for a usual flight.
    """

    course: str
    overrides: tuple[str, ...] = ()
    search: str = ""
    change: str = ""
    starts: tuple[int, ...] = ()
    refine: int | None = None
    threads: int = 1

    @property
    def key(self) -> str:
        """What tells one job from another."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)

    @staticmethod
    def read(key: str) -> "Job":
        """The job of a key."""
        fields = json.loads(key)
        return Job(**{name: tuple(one) if isinstance(one, list) else one for name, one in fields.items()})

    def __str__(self) -> str:
        parts = [self.course, *self.overrides, self.search and f"search {self.search}", self.change]
        parts += [f"starts {self.starts[0]} to {self.starts[-1]}"] if self.starts else []
        parts += [] if self.refine is None else [f"start {self.refine} refined"]
        return ", ".join(part for part in parts if part)


def inputs_of(course: str, overrides: Sequence[str] = (), search: str = "") -> Inputs:
    """The inputs of a course.

    Raises:
        InputError: with all findings.
    """
    chosen = [*overrides, *exploring(search)]
    if course.startswith("seed "):
        with tempfile.TemporaryDirectory() as folder:
            track = Path(folder) / f"{course.replace(' ', '_')}.yaml"
            track.write_text(random_course(int(course.split()[1]), str(ROOT / "configs")), encoding="utf-8")
            return load_inputs(track, overrides=chosen)
    return load_inputs(ROOT / "tracks" / f"{course}.yaml" if course in SHIPPED else Path(course), overrides=chosen)


def exploring(search: str) -> list[str]:
    """The override that chooses how much is explored; where settings do not know it, `off` is all there is."""
    known = "search" in {field.name for field in dataclasses.fields(Settings)}
    return [f"settings.search={search}"] if search and (known or search != OFF) else []


class Log:
    """Records by job, in memory and, where there is a file, in its lines."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.records: dict[str, Record] = {}
        if path is None or not path.exists():
            return
        text = path.read_text(encoding="utf-8")
        for line in text.splitlines():
            try:
                record = json.loads(line)
                self.records[Job.read(record["job"]).key] = record
            except (ValueError, KeyError, TypeError):
                continue  # a line that an interruption has cut short, or of another program
        if text and not text.endswith("\n"):
            path.write_text(text + "\n", encoding="utf-8")

    def add(self, job: Job, record: Record) -> None:
        """Keep a record."""
        record = {"job": job.key, **record}
        self.records[job.key] = record
        if self._path is not None and record["outcome"] not in AGAIN:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")


@dataclass(frozen=True)
class Study:
    """Flies jobs, `at_once` of them at a time, each stopped after `timeout` seconds."""

    log: Log
    at_once: int = 1
    timeout: float = 900.0

    def fly(self, jobs: Iterable[Job]) -> list[Record]:
        """The records of jobs, in their order."""
        wanted = list(jobs)
        missing = list(dict.fromkeys(job for job in wanted if job.key not in self.log.records))
        pool = ThreadPoolExecutor(self.at_once)
        try:
            futures = {pool.submit(flown, job, self.timeout): job for job in missing}
            for number, future in enumerate(as_completed(futures), start=1):
                job, record = futures[future], future.result()
                self.log.add(job, record)
                print(f"{number}/{len(missing)} {job}: {told(record)}", file=sys.stderr, flush=True)
        except BaseException:  # an interrupted study leaves no process behind
            for process in list(RUNNING):
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)
        return [self.log.records[job.key] for job in wanted]


def told(record: Record) -> str:
    """A record in a line."""
    race = record.get("race_time_s")
    said = f" ({record['message']})" if record.get("message") else ""
    return record["outcome"] + ("" if race is None else f", {race:.3f} s") + f" in {record['seconds']:.1f} s{said}"


def race_time(record: Record) -> float | None:
    """Of a certified flight, s; None of any other."""
    return record["race_time_s"] if record["outcome"] == CERTIFIED else None


def flown(job: Job, timeout: float) -> Record:
    """Run one job in a process."""
    process = subprocess.Popen(
        [sys.executable, str(FLIGHT), job.key],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    RUNNING.add(process)
    try:
        output, errors, late = ended(process, timeout)
    finally:
        RUNNING.discard(process)
    if late:
        return {"outcome": "out of time", "race_time_s": None, "seconds": timeout, "message": ""}
    try:
        return json.loads(output.splitlines()[-1])
    except (ValueError, IndexError):
        said = [line for line in errors.splitlines() if line.strip()]
        return {"outcome": "died", "race_time_s": None, "seconds": 0.0, "message": said[-1] if said else ""}


def ended(process: "subprocess.Popen[str]", timeout: float) -> tuple[str, str, bool]:
    """What a process printed, to both ends, and whether it took too long and was stopped."""
    try:
        return *process.communicate(timeout=timeout), False
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
    try:
        return *process.communicate(timeout=GRACE), True
    except subprocess.TimeoutExpired:
        process.kill()
        return *process.communicate(), True
