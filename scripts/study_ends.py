"""Fly courses with a settled and with a free start, and print as a Markdown table what the settled one costs.

    python scripts/study_ends.py [tracks/*.yaml] [--until six-dof] [--log ends.jsonl] [--write docs/ends.md]

Every run is `airrace optimize --guess plan` in a process of its own, one after the other, with the finish that the
course asks for. With `--log`, runs are kept there line by line, and those that are found there are not flown again;
`--write` puts the table between the markers of a document. `--set KEY=VALUE` changes the courses.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from airrace.checkpoint import read_checkpoint
from airrace.procedure.result import Stage

ROOT = Path(__file__).resolve().parent.parent
COMMAND = (sys.executable, "-P", "-m", "airrace")
STARTS = ("settled", "free")
BEGIN, END = "<!-- begin of the table of scripts/study_ends.py -->", "<!-- end of the table -->"
DEGREES = 57.29577951308232
SHOWN = {"p_K": "rolls at {:.0f}°/s", "beta_K": "slips by {:.1f}°", "zeta": "rudder {:.0f}°"}
"""What of a free start is told: states in rad or rad/s."""


@dataclass(frozen=True)
class Flown:
    """One run: race times (s) of its certified stages, and the first state of its last stage (SI) by name."""

    course: str
    start: str
    until: str
    changes: tuple[str, ...]
    times: dict[str, float]
    state: dict[str, float]

    @property
    def key(self) -> tuple[str, str, str, tuple[str, ...]]:
        return self.course, self.start, self.until, tuple(self.changes)


def main() -> None:
    """Fly, print, write."""
    arguments = _arguments()
    known = _logged(arguments.log)
    runs: dict[tuple[str, str], Flown] = {}
    for course in arguments.courses:
        for start in STARTS:
            key = (course.stem, start, arguments.until, tuple(arguments.set))
            run = known.get(key) or _fly(course, start, arguments.until, arguments.set)
            if key not in known and arguments.log:
                with arguments.log.open("a", encoding="utf-8") as log:
                    log.write(json.dumps(asdict(run)) + "\n")
            runs[course.stem, start] = run
            print(f"{course.stem}, {start}: {run.times}", file=sys.stderr, flush=True)
    table = "\n".join(_table([course.stem for course in arguments.courses], runs, arguments.until))
    print(table)
    if arguments.write:
        before, _, rest = arguments.write.read_text(encoding="utf-8").partition(BEGIN)
        _, _, after = rest.partition(END)
        arguments.write.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}", encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("courses", nargs="*", type=Path, default=sorted((ROOT / "tracks").glob("*.yaml")))
    parser.add_argument("--until", default=Stage.SIX_DOF.value, help="the last stage")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="passed on to every run")
    parser.add_argument("--log", type=Path, help="keeps the runs")
    parser.add_argument("--write", type=Path, help="a document with the markers of the table")
    return parser.parse_args()


def _logged(log: Path | None) -> dict[tuple[str, str, str, tuple[str, ...]], Flown]:
    if log is None or not log.exists():
        return {}
    runs = [Flown(**json.loads(line)) for line in log.read_text(encoding="utf-8").splitlines()]
    return {run.key: run for run in runs}


def _fly(course: Path, start: str, until: str, changes: Sequence[str]) -> Flown:
    settings = [f"course.start_state={start}", *changes]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run.h5"
        options = ["--until", until, "--guess", "plan", "--mesh-check", "all", "--quiet", "--output", str(out)]
        options += [word for one in settings for word in ("--set", one)]
        ran = subprocess.run([*COMMAND, "optimize", str(course), *options], capture_output=True, text=True, check=False)
        if not out.exists():
            raise SystemExit(f"{course.stem}, {start}: {ran.stderr.strip()}")
        results = [stage.result for stage in read_checkpoint(out).stages]
    last = results[-1].trajectory
    return Flown(
        course=course.stem,
        start=start,
        until=until,
        changes=tuple(changes),
        times={one.stage.value: one.trajectory.race_time for one in results if one.certified},
        state={one.name: float(row[0]) for one, row in zip(last.states, last.state, strict=True)},
    )


def _table(courses: Sequence[str], runs: dict[tuple[str, str], Flown], until: str) -> list[str]:
    """One line per course: race times of the point mass and of the last stage with both starts."""
    stages = list(dict.fromkeys((Stage.POINT_MASS.value, until)))
    titles = [f"{stage}, {what}" for stage in stages for what in ("free", "settled", "cost")]
    lines = [f"| course | {' | '.join(titles)} | the free start |", "|---" * (len(titles) + 2) + "|"]
    for course in courses:
        settled, free = runs[course, "settled"], runs[course, "free"]
        cells = [cell for stage in stages for cell in _compared(free.times.get(stage), settled.times.get(stage))]
        lines.append(f"| `{course}` | {' | '.join(cells)} | {_told(free)} |")
    return lines


def _compared(free: float | None, settled: float | None) -> tuple[str, str, str]:
    times = tuple("not certified" if one is None else f"{one:.3f} s" for one in (free, settled))
    cost = "" if free is None or settled is None else f"{1000.0 * (settled - free):.1f} ms"
    return times[0], times[1], cost


def _told(run: Flown) -> str:
    """How the aircraft starts where it may start in any way."""
    told = [text.format(DEGREES * run.state[name]) for name, text in SHOWN.items() if name in run.state]
    return ", ".join(told)


if __name__ == "__main__":
    main()
