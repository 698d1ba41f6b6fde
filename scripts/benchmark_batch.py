"""How `airrace batch` does at scale, measured on the real command.

    python scripts/benchmark_batch.py plan [--jobs 10000] [--files 8]
    python scripts/benchmark_batch.py speed [TRACK.yaml ...] [--slots 2] [--until STAGE]
    python scripts/benchmark_batch.py battery [--jobs 300] [--killed 0.05] [--slots 2]

`plan` times `--dry-run` of many jobs: of new ones, and of finished ones (made up), whose records and checkpoints are
all looked at. `speed` compares a batch with the same runs one after another, each with `--threads 1`. `battery` flies
small courses drawn by lot up to the point mass while processes (jobs and solvers alike) are killed at random, calls the
batch again until nothing is left to do, and tells what became of the jobs and what memory the batch took. It ends with
1 if a job is lost, or flown again after it had finished.
"""

import argparse
import itertools
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from generated_courses import generated_course  # noqa: E402  (the folder above must be on the path first)

from airrace.batch.planning import make_plan  # noqa: E402
from airrace.batch.record import FileMark, JobRecord, checkpoint_path, record_path, write_record  # noqa: E402
from airrace.batch.sources import Manner, find_sources, parse_sweeps  # noqa: E402
from airrace.inputs import load_inputs  # noqa: E402
from airrace.runs.run import library_versions  # noqa: E402

COMMAND = (sys.executable, "-P", "-m", "airrace")
SMALL = 8  # passings of a course of the battery, at most
STAGES = ("homotopy", "point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof")
ITEM = {
    "name": "path_angular_rate",
    "value": 1e-4,
    "limit": 1e-3,
    "unit": "rad/s",
    "holds": True,
    "where": "1:g1 -> 1:g2",
}


def plan(jobs: int, files: int) -> None:
    """Time `--dry-run`."""
    with tempfile.TemporaryDirectory() as folder:
        courses = Path(folder) / "courses"
        courses.mkdir()
        shipped = sorted((ROOT / "tracks").glob("*.yaml"))
        for number in range(files):
            text = shipped[number % len(shipped)].read_text()
            (courses / f"course_{number}.yaml").write_text(text)
        winds = max(1, jobs // files)
        sweeps = [f"environment.wind.speed_kt=0:{(winds - 1) * 0.01:.2f}:0.01"] if winds > 1 else []
        manner = Manner(overrides=("environment.wind.from_deg=0",) if sweeps else (), sweeps=parse_sweeps(sweeps))
        arguments = [f"{courses}/*.yaml", *(["--sweep", sweeps[0], "--set", manner.overrides[0]] if sweeps else [])]
        out = Path(folder) / "out"
        dry_run(arguments, out, "new jobs")
        out.mkdir()
        versions = ", ".join(f"{name} {number}" for name, number in library_versions().items())
        made = make_plan(find_sources([f"{courses}/*.yaml"], manner), out, until=STAGES[-1], versions=versions)
        stages = [{"stage": stage, "certificate": {"items": [ITEM] * 14}} for stage in STAGES]
        for step in made.steps:
            assert step.job is not None
            path = checkpoint_path(out, step.name)
            path.write_bytes(b"made up")
            run = {"race_time_s": 60.0, "stages": stages}
            write_record(out, step.name, JobRecord(step.job.fingerprint, True, run=run, checkpoint=FileMark.of(path)))
        dry_run(arguments, out, "finished jobs")


def dry_run(arguments: list[str], out: Path, what: str) -> None:
    started = time.perf_counter()
    command = [*COMMAND, "batch", *arguments, "--output", str(out), "--dry-run", "--json"]
    answer = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
    print(f"{what}: {answer['counts']} in {time.perf_counter() - started:.1f} s", flush=True)


def speed(tracks: list[Path], slots: int, until: str) -> None:
    """A batch against its runs one after another."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--set", "settings.guess=plan", "--until", until, "--quiet"]
        alone = 0.0
        for track in tracks:
            started = time.perf_counter()
            out = ["--threads", "1", "--output", f"{folder}/{track.stem}.h5"]
            subprocess.run([*COMMAND, "optimize", str(track), *options, *out], check=False)
            alone += time.perf_counter() - started
            print(f"{track.stem}: {time.perf_counter() - started:.1f} s", flush=True)
        started = time.perf_counter()
        names = [str(track) for track in tracks]
        command = [*COMMAND, "batch", *names, *options, "--jobs", str(slots), "--output", f"{folder}/batch"]
        code = subprocess.run(command, check=False).returncode
        together = time.perf_counter() - started
    print(f"one after another {alone:.1f} s, {slots} at a time {together:.1f} s: {together / alone:.2f} (code {code})")


def battery(jobs: int, killed: float, slots: int) -> bool:
    """Fly many courses while some of their processes are killed; whether all are accounted for, none repeated."""
    chance = random.Random(0)
    with tempfile.TemporaryDirectory() as folder:
        courses, out = Path(folder) / "courses", Path(folder) / "out"
        courses.mkdir()
        write_small_courses(courses, jobs)
        options = ["--until", "point-mass", "--set", "settings.guess=plan", "--timeout", "300", "--jobs", str(slots)]
        command = [*COMMAND, "batch", f"{courses}/*.yaml", *options, "--output", str(out), "--json"]
        ended: Counter[str] = Counter()
        good = True
        for call in range(1, 10):
            marks = {path: path.stat().st_mtime_ns for path in out.glob("*.h5") if finished(path)}
            answer = fly(command, chance, killed if call == 1 else 0.0)
            repeated = [path.stem for path, mark in marks.items() if path.stat().st_mtime_ns != mark]
            ended = Counter(job["state"] for job in answer["jobs"])
            flown = [job["name"] for job in answer["jobs"] if not job["kept"]]
            retried = sum(len(job["retries"]) for job in answer["jobs"] if not job["kept"])
            print(f"call {call}: {dict(ended)}; flown {len(flown)}, tried again {retried}, repeated {len(repeated)}")
            good = good and len(answer["jobs"]) == jobs and not repeated
            if not flown:
                break
    return good and sum(ended.values()) == jobs


def write_small_courses(folder: Path, count: int) -> None:
    """The first so many courses drawn by lot that have no more than `SMALL` passings."""
    written = 0
    for seed in itertools.count():
        if written == count:
            return
        path = folder / f"seed_{seed}.yaml"
        path.write_text(generated_course(seed, str(ROOT / "configs")))
        if len(load_inputs(path).race.course.passages) > SMALL:
            path.unlink()
        else:
            written += 1


def finished(checkpoint: Path) -> bool:
    """Whether the record beside a checkpoint says that its job gave an answer."""
    record = json.loads(record_path(checkpoint.parent, checkpoint.stem).read_text())
    return record["ended"] and record["code"] in (0, 4, 5)


def fly(command: list[str], chance: random.Random, killed: float) -> dict:
    """Run a batch; of every job's processes one is killed with this probability, a moment after it began."""
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL)
        due: list[tuple[float, int]] = []
        seen: set[int] = set()
        sizes: list[float] = []
        while process.poll() is None:
            for job in set(children(process.pid)) - seen:
                seen.add(job)
                if chance.random() < killed:
                    due.append((time.monotonic() + chance.uniform(0.2, 3.0), job))
            for when, job in [one for one in due if one[0] < time.monotonic()]:
                due.remove((when, job))
                victim = chance.choice([job, *children(job)])
                if job in children(process.pid):
                    os.kill(victim, signal.SIGKILL)
            sizes.append(resident(process.pid))
            time.sleep(0.05)
        output.seek(0)
        sizes = [size for size in sizes if size]
        quarters = [max(sizes[len(sizes) * part // 4 : len(sizes) * (part + 1) // 4 or 1]) for part in range(4)]
        print(f"memory of the batch by quarter, MiB: {', '.join(f'{size:.1f}' for size in quarters)}", flush=True)
        return json.load(output)


def children(process: int) -> list[int]:
    try:
        return [int(one) for one in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


def resident(process: int) -> float:
    """Memory of a process, MiB; 0 once it is gone."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 2**20
    except (OSError, IndexError):
        return 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure airrace batch.")
    parts = parser.add_subparsers(dest="part", required=True)
    planning = parts.add_parser("plan", help="time --dry-run of many jobs")
    planning.add_argument("--jobs", type=int, default=10_000)
    planning.add_argument("--files", type=int, default=8, help="courses among which the jobs are divided")
    racing = parts.add_parser("speed", help="a batch against its runs one after another")
    racing.add_argument("tracks", nargs="*", type=Path, default=sorted((ROOT / "tracks").glob("*.yaml")))
    racing.add_argument("--slots", type=int, default=2)
    racing.add_argument("--until", default="six-dof")
    killing = parts.add_parser("battery", help="many jobs, of which some are killed")
    killing.add_argument("--jobs", type=int, default=300)
    killing.add_argument("--killed", type=float, default=0.05, help="share of the jobs")
    killing.add_argument("--slots", type=int, default=2)
    arguments = parser.parse_args()
    if arguments.part == "plan":
        plan(arguments.jobs, arguments.files)
    elif arguments.part == "speed":
        speed(list(arguments.tracks), arguments.slots, arguments.until)
    elif not battery(arguments.jobs, arguments.killed, arguments.slots):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
