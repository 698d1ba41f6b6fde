"""What the robustness studies share: a log to go on with, commands in this process or in their own, and findings."""

import argparse
import contextlib
import json
import os
import random
import resource
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from airrace.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (sys.executable, "-P", "-m", "airrace")
SMALL = ("half_cuban_eight", "--until", "point-mass", "--guess", "plan", "--search", "off")
Record = dict[str, Any]  # Any: JSON
Part = tuple[int, int]  # number, of how many


@dataclass(frozen=True)
class Ran:
    """A command that has ended, with the seconds it took and the warnings of libraries meanwhile."""

    code: int
    out: str
    err: str
    seconds: float
    warned: tuple[str, ...] = ()

    def faults(self, longest: float) -> list[str]:
        """What no command may do, whatever it is given."""
        found = [f"warning: {one}" for one in self.warned]
        if "Traceback" in self.out + self.err:
            found.append("traceback: " + self.err.strip().splitlines()[-1][:200])
        if "this is a bug" in self.err or self.code == 1:
            found.append(f"code {self.code}: {self.err.strip()[-200:]}")
        if "No such option" in self.err:
            found.append("the study calls the command wrongly")
        if self.seconds > longest:
            found.append(f"took {self.seconds:.1f} s")
        return found


def inside(*arguments: str | Path) -> Ran:
    """Run a command in this process; its seconds are those of the processor, so that other work does not count."""
    began = time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ran = CliRunner().invoke(app, [str(one) for one in arguments])
    told = tuple(str(one.message) for one in caught if issubclass(one.category, RuntimeWarning))
    error = ran.exception
    crashed = "" if error is None or isinstance(error, SystemExit) else f"\nTraceback: {type(error).__name__}: {error}"
    return Ran(ran.exit_code, ran.stdout, ran.stderr + crashed, time.process_time() - began, told)


def apart(*arguments: str | Path, **changed: str) -> Ran:
    """Run a command in a process of its own, with other environment variables."""
    began, command = time.monotonic(), [*COMMAND, *(str(one) for one in arguments)]
    ended = subprocess.run(command, env=environment(**changed), capture_output=True, text=True, check=False)
    return Ran(ended.returncode, ended.stdout, ended.stderr, time.monotonic() - began)


def peak_memory() -> float:
    """The largest resident memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


@dataclass
class Study:
    """Numbered trials, each with a seed of its own; those in the log are not played again.

    Attributes:
        seed: the seed of the study; trial `n` draws from `random.Random(f"{seed}/{n}")`.
        log: JSON lines, one per trial; None to keep nothing.
    """

    seed: int
    log: Path | None = None
    records: list[Record] = field(default_factory=list[Record])

    def play(self, count: int, trial: Callable[[random.Random, int], Record], part: Part = (1, 1)) -> None:
        """Play the trials 0 to `count` - 1 that the log does not hold yet: those of one part, if there are several."""
        done = {one["number"]: one for one in self._logged()}
        for number in range(count):
            record = done.get(number)
            if record is None:
                if number % part[1] != part[0] - 1:
                    continue
                record = {"seed": self.seed, "number": number, **trial(random.Random(f"{self.seed}/{number}"), number)}
                self._keep(record)
            self.records.append(record)

    def _logged(self) -> Iterator[Record]:
        if self.log is None or not self.log.exists():
            return
        for line in self.log.read_text(encoding="utf-8").splitlines():
            with contextlib.suppress(ValueError):  # the last line of a study that was killed
                if (record := json.loads(line))["seed"] == self.seed:
                    yield record

    def _keep(self, record: Mapping[str, object]) -> None:
        if self.log is not None:
            with self.log.open("a", encoding="utf-8") as file:
                file.write(json.dumps(record) + "\n")

    def report(self) -> int:
        """Print counts by kind and outcome, and every fault; return the exit code, 0 without faults."""
        rows = Counter((one["kind"], one["outcome"]) for one in self.records)
        print(f"seed {self.seed}, {len(self.records)} trials\n\n| kind | outcome | trials |\n|---|---|---:|")
        for (kind, outcome), count in sorted(rows.items()):
            print(f"| {kind} | {outcome} | {count} |")
        faults = [(one["number"], one["kind"], text) for one in self.records for text in one["faults"]]
        longest = max((one.get("seconds", 0.0) for one in self.records), default=0.0)
        print(f"\nlongest {longest:.2f} s, faults: {len(faults)}")
        for number, kind, text in faults:
            print(f"- number {number}, {kind}: {text}")
        return 1 if faults else 0


def options(description: str, count: int) -> argparse.ArgumentParser:
    """A parser of the options of a study: how many trials, from which seed, with which log."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--count", type=int, default=count, help="trials")
    parser.add_argument("--seed", type=int, default=1, help="of the study")
    parser.add_argument("--log", type=Path, metavar="FILE", help="JSON lines; what is in it is not played again")
    parser.add_argument("--part", type=part_of, default=(1, 1), metavar="K/N", help="every Nth trial, in one log")
    return parser


def part_of(text: str) -> Part:
    """Return part and count of `K/N`."""
    part, count = (int(one) for one in text.split("/"))
    if not 1 <= part <= count:
        raise ValueError(text)
    return part, count


def play_study(description: str, count: int, trial: Callable[[random.Random, int], Record]) -> int:
    """Play a study as its arguments ask; `count` is that of trials by default. Return the exit code."""
    arguments = options(description, count).parse_args()
    study = Study(arguments.seed, arguments.log)
    study.play(arguments.count, trial, arguments.part)
    return study.report()


def environment(**changed: str) -> dict[str, str]:
    """The environment of a command: one thread, and this source tree."""
    return {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), **changed}


def outcome(code: int) -> str:
    """An exit code as a word."""
    words = {0: "done", 2: "usage", 3: "refused", 4: "infeasible", 5: "not certified", 6: "out of time"}
    return {**words, 7: "refused", 8: "system", 130: "interrupted"}.get(code, f"code {code}")


def first(texts: Iterable[str]) -> str:
    """The first line with a finding, for records."""
    return next((text.strip()[:160] for text in texts if text.strip()), "")


def choice_of(rng: random.Random, kinds: Mapping[str, Any]) -> tuple[str, Any]:  # Any: what the kinds stand for
    """One of the kinds, all alike."""
    names: Sequence[str] = sorted(kinds)
    name = rng.choice(names)
    return name, kinds[name]
