"""Fly many courses, drawn by lot or given, and tell how each of them ended.

    python scripts/survey_courses.py --seeds 0-49 [--guess both] [--until STAGE] [--jobs 1] [--timeout 600] [--log FILE]
    python scripts/survey_courses.py tracks/*.yaml [--set rules.n_z_max=9]

Every run is `airrace optimize` in a process of its own, so that nothing it does can end the survey. One line is printed
(and appended to the log) as each run ends: course, aircraft, passages, guess, outcome, race time, wall time of the
command, iterations, mesh refinements, and what was said. The last lines count, per guess and for the better of both.
"""

import argparse
import json
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from random_courses import random_course

from airrace.checkpoint import read_checkpoint
from airrace.errors import AirraceError
from airrace.inputs import load_inputs

ROOT = Path(__file__).resolve().parent.parent
COMMAND = (sys.executable, "-P", "-m", "airrace")
GUESSES = {"plan": ("plan",), "homotopy": ("homotopy",), "both": ("plan", "homotopy")}
CERTIFIED = "certified"
GRACE = 20.0  # s, that a run which is told to stop may take
HEADINGS = (
    f"{'course':<20}{'aircraft':<10}{'pass.':>6} {'guess':<9}{'outcome':<15}"
    f"{'race s':>9}{'wall s':>8}{'iter.':>7}{'ref.':>5}  message"
)


@dataclass(frozen=True)
class Run:
    """How one run ended; what is not known of it is None."""

    course: str
    aircraft: str
    passages: int | None
    guess: str
    outcome: str
    race: float | None
    wall: float
    iterations: int | None
    refinements: int | None
    message: str

    @property
    def certified(self) -> bool:
        return self.outcome == CERTIFIED

    @property
    def line(self) -> str:
        columns = (
            f"{self.course:<20}{self.aircraft:<10}{told(self.passages):>6} {self.guess:<9}{self.outcome:<15}",
            f"{told(self.race):>9}{self.wall:>8.1f}{told(self.iterations):>7}{told(self.refinements):>5}",
        )
        return f"{''.join(columns)}  {self.message}".rstrip()


def told(value: float | None) -> str:
    """A number for the table."""
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def fly(track: Path, guess: str, until: str, overrides: Sequence[str], *, threads: int | None, timeout: float) -> Run:
    """One run of the command in a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        checkpoint = Path(folder) / "run.h5"
        command = [*COMMAND, "optimize", str(track), "--guess", guess, "--until", until]
        command += ["--json", "--quiet", "--output", str(checkpoint)]
        command += [part for one in overrides for part in ("--set", one)]
        command += [] if threads is None else ["--threads", str(threads)]
        started = time.perf_counter()
        code, output, errors = ended(command, timeout)
        wall = time.perf_counter() - started
        refinements = refinements_of(checkpoint)
    aircraft, passages = inputs_of(track, overrides)
    answer = answer_of(output)
    stages = answer.get("stages") or []
    outcome, message = verdict(code, answer, errors)
    return Run(
        course=track.stem,
        aircraft=aircraft,
        passages=passages,
        guess=guess,
        outcome=outcome,
        race=answer.get("race_time_s"),
        wall=wall,
        iterations=sum(stage["iterations"] for stage in stages) if stages else None,
        refinements=refinements,
        message=message,
    )


def ended(command: Sequence[str], timeout: float) -> tuple[int | None, str, str]:
    """Exit code, stdout and stderr of a command; no code where it took too long and was stopped."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        output, errors = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
        try:
            output, errors = process.communicate(timeout=GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            output, errors = process.communicate()
        return None, output, errors
    return process.returncode, output, errors


# The JSON of the command: its keys stand in docs/command_line.md.
def answer_of(output: str) -> dict:
    """The object that was printed; empty where none was."""
    try:
        answer = json.loads(output)
    except json.JSONDecodeError:
        return {}
    return answer if isinstance(answer, dict) else {}


def verdict(code: int | None, answer: dict, errors: str) -> tuple[str, str]:
    """The outcome in a word or two, and what was said about it."""
    stages = answer.get("stages") or []
    if code is None:
        return "out of time", f"in {stages[-1]['stage']}" if stages else ""
    if code == 0 and answer.get("certified"):
        return CERTIFIED, ""
    said = answer.get("error") or next((line for line in reversed(errors.splitlines()) if line.strip()), "")
    findings = [f"{one['line']}: {one['key']}: {one['message']}" for one in answer.get("findings") or []]
    message = re.sub(r"\s+", " ", "; ".join([str(said), *findings[:1]]))
    if stages and code in (4, 5, 6):
        return stages[-1]["status"], message
    return {3: "invalid input", 8: "system"}.get(code, f"exit code {code}"), message


def refinements_of(checkpoint: Path) -> int | None:
    """How often the mesh of the last stage was refined, as the purposes of its solver calls tell."""
    try:
        last = read_checkpoint(checkpoint).stages[-1]
    except (AirraceError, OSError, IndexError):
        return None
    numbers = [re.search(r"refinement (\d+)", attempt.purpose) for attempt in last.result.attempts]
    return max((int(number[1]) for number in numbers if number), default=0)


def inputs_of(track: Path, overrides: Sequence[str]) -> tuple[str, int | None]:
    """The file name of the aircraft and the number of passages."""
    try:
        inputs = load_inputs(track, overrides=overrides)
    except AirraceError:
        return "-", None
    return Path(inputs.aircraft.path).stem, len(inputs.race.course.passages)


def summary(runs: Sequence[Run]) -> Iterable[str]:
    """Counts per guess, and over all guesses of a course."""
    for guess in dict.fromkeys(run.guess for run in runs):
        of_guess = [run for run in runs if run.guess == guess]
        outcomes = Counter(run.outcome for run in of_guess)
        others = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common() if outcome != CERTIFIED)
        wall = statistics.median(run.wall for run in of_guess)
        line = f"{guess}: certified {outcomes[CERTIFIED]} of {len(of_guess)}, median {wall:.1f} s"
        yield f"{line}; {others}" if others else line
    courses: dict[str, list[Run]] = {}
    for run in runs:
        courses.setdefault(run.course, []).append(run)
    if any(len(several) > 1 for several in courses.values()):
        certified = sum(any(run.certified for run in of_course) for of_course in courses.values())
        yield f"either guess: certified {certified} of {len(courses)} courses"
        yield from disagreements(courses)


def disagreements(courses: dict[str, list[Run]]) -> Iterable[str]:
    """Courses on which two guesses were certified with race times more than half a percent apart."""
    for course, runs in courses.items():
        times = {run.guess: run.race for run in runs if run.certified and run.race is not None}
        if len(times) > 1 and max(times.values()) > 1.005 * min(times.values()):
            yield f"  {course}: " + ", ".join(f"{guess} {race:.3f} s" for guess, race in times.items())


def numbers(text: str) -> list[int]:
    """`0-49` or `3,7,20-29` as a list."""
    seeds: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip())
        if match is None or (match[2] and int(match[2]) < int(match[1])):
            raise argparse.ArgumentTypeError(f"`{part}` is neither a seed nor a range such as 0-49")
        seeds += range(int(match[1]), int(match[2] or match[1]) + 1)
    return seeds


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Fly many courses and tell how each of them ended.")
    parser.add_argument("tracks", nargs="*", type=Path, metavar="TRACK.yaml")
    parser.add_argument("--seeds", type=numbers, default=[], metavar="0-49", help="of generated courses")
    parser.add_argument("--guess", choices=GUESSES, default="both")
    parser.add_argument("--until", default="point-mass", metavar="STAGE", help="as of airrace optimize")
    parser.add_argument("--jobs", type=int, default=1, help="runs at the same time")
    parser.add_argument("--threads", type=int, help="of each run; by default all cores, one with several jobs")
    parser.add_argument("--timeout", type=float, default=600.0, metavar="SECONDS", help="for each run")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of airrace optimize")
    parser.add_argument("--log", type=Path, metavar="FILE", help="append all lines to a file as well")
    arguments = parser.parse_args()
    if not arguments.tracks and not arguments.seeds:
        parser.error("give track files, --seeds, or both")
    return arguments


def main() -> None:
    arguments = parsed()

    def tell(line: str) -> None:
        print(line, flush=True)
        if arguments.log is not None:
            with arguments.log.open("a", encoding="utf-8") as log:
                log.write(line + "\n")

    threads = arguments.threads or (1 if arguments.jobs > 1 else None)
    tell(HEADINGS)
    runs: list[Run] = []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.jobs) as pool:
        tracks = list(arguments.tracks)
        for seed in arguments.seeds:
            tracks.append(Path(folder) / f"seed_{seed}.yaml")
            tracks[-1].write_text(random_course(seed, str(ROOT / "configs")), encoding="utf-8")
        flights = [
            pool.submit(fly, track, guess, arguments.until, arguments.set, threads=threads, timeout=arguments.timeout)
            for track in tracks
            for guess in GUESSES[arguments.guess]
        ]
        try:
            for flight in as_completed(flights):
                runs.append(flight.result())
                tell(runs[-1].line)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise SystemExit(130) from None
    for line in summary(runs):
        tell(line)


if __name__ == "__main__":
    main()
