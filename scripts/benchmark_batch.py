"""How `airrace batch` does at scale, measured on the real command.

    python scripts/benchmark_batch.py plan [--jobs 10000] [--files 8]
    python scripts/benchmark_batch.py speed [TRACK.yaml ...] [--slots 2] [--until STAGE]

`plan` times `--dry-run` of many jobs: of new ones, and of finished ones (made up), whose records and checkpoints are
all looked at. `speed` compares a batch with the same runs one after another, each with `--threads 1`.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from airrace.runs.batch.planning import JobTemplate, find_sources, make_plan, parse_sweeps
from airrace.runs.batch.record import FileMark, JobRecord, checkpoint_path, write_record
from airrace.runs.stored_inputs import library_versions

ROOT = Path(__file__).resolve().parents[1]
COMMAND = (sys.executable, "-P", "-m", "airrace")
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
        template = JobTemplate(
            overrides=("environment.wind.from_deg=0",) if sweeps else (), sweeps=parse_sweeps(sweeps)
        )
        arguments = [f"{courses}/*.yaml", *(["--sweep", sweeps[0], "--set", template.overrides[0]] if sweeps else [])]
        out = Path(folder) / "out"
        dry_run(arguments, out, "new jobs")
        out.mkdir()
        versions = ", ".join(f"{name} {number}" for name, number in library_versions().items())
        made = make_plan(find_sources([f"{courses}/*.yaml"], template), out, until=STAGES[-1], versions=versions)
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
    arguments = parser.parse_args()
    if arguments.part == "plan":
        plan(arguments.jobs, arguments.files)
    else:
        speed(list(arguments.tracks), arguments.slots, arguments.until)


if __name__ == "__main__":
    main()
