"""Commands killed and interrupted at random moments: what they have announced is stored, and nothing stays behind.

python scripts/experiments/signals.py [--count N] [--seed SEED] [--log FILE] [--part K/N] [--signals SIGKILL ...]
"""

import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from robustness import COMMAND, SMALL, Ran, Record, Study, choice_of, environment, options, outcome

import airrace

PROMPT = 2.0  # s from a signal to the end
HANGS = 60.0  # s after which a command that nobody stopped counts as hanging
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
CODES = {signal.SIGKILL: -9, signal.SIGTERM: 130, signal.SIGINT: 130}
WITHIN = 2.5  # s, the latest moment of a signal
LADDER = ("half_cuban_eight", "--guess", "plan", "--search", "off", "--mesh-check", "all")
COMMANDS: dict[str, tuple[str, ...]] = {
    "optimize": ("optimize", *SMALL, "--output", "run.h5"),
    "optimize, ladder": ("optimize", *LADDER, "--output", "run.h5"),
    "resume": ("resume", "old.h5"),
    "verify": ("verify", "old.h5"),
    "export": ("export", "csv", "old.h5", "--output", "out.csv"),
    "batch": ("batch", "half_cuban_eight", "--until", "point-mass", "--set", "settings.guess=plan", "--output", "b"),
}
ANNOUNCED = re.compile(r"([a-z-]+): (?:solved|certified)")


def run(*arguments: str, folder: Path) -> Ran:
    """A command to its end."""
    began = time.monotonic()
    ran = subprocess.run(
        [*COMMAND, *arguments],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=HANGS,
        check=False,
    )
    return Ran(ran.returncode, ran.stdout, ran.stderr, time.monotonic() - began)


def left_behind(mark: str) -> list[int]:
    """Processes that were started with a mark in their environment and still run (Linux)."""
    found: list[int] = []
    for process in Path("/proc").iterdir():
        if not process.name.isdigit() or int(process.name) == os.getpid():
            continue
        try:
            marked = mark.encode() in (process / "environ").read_bytes()
            state = (process / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if marked and state not in "ZX":
            found.append(int(process.name))
    return found


def stored(path: Path, folder: Path) -> set[str]:
    """The stages in a checkpoint."""
    shown = run("show", path.name, "--json", folder=folder)
    return {one["stage"] for one in json.loads(shown.out)["stages"]} if shown.code == 0 else set()


def trial(rng: random.Random, number: int, signals: Sequence[signal.Signals] = SIGNALS) -> Record:
    with tempfile.TemporaryDirectory() as name:
        return played(rng, Path(name), f"airrace-study-{os.getpid()}-{number}", signals)


def played(rng: random.Random, folder: Path, mark: str, signals: Sequence[signal.Signals]) -> Record:
    """One command, one of the signals, and what became of it."""
    kind, command = choice_of(rng, COMMANDS)
    sent, moment = rng.choice(signals), rng.uniform(0.0, WITHIN)
    if "old.h5" in command:
        assert run("optimize", *SMALL, "--output", "old.h5", folder=folder).code == 0
    with (folder / "out").open("w") as out, (folder / "err").open("w") as err:
        process = subprocess.Popen(
            [*COMMAND, *command], cwd=folder, env=environment(AIRRACE_STUDY=mark), stdout=out, stderr=err
        )
        faults: list[str] = []
        seconds, signalled = 0.0, False
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            signalled, began = True, time.monotonic()
            process.send_signal(sent)
            try:
                process.wait(HANGS)
            except subprocess.TimeoutExpired:
                faults.append("hangs")
                process.kill()
                process.wait()
            seconds = time.monotonic() - began
    ran = Ran(process.returncode, (folder / "out").read_text(), (folder / "err").read_text(), seconds)
    if signalled and before_airrace(ran):
        return {
            "kind": f"{kind}, {sent.name}",
            "outcome": "before airrace",
            "seconds": seconds,
            "moment": moment,
            "faults": [],
        }
    faults += ran.faults(PROMPT)
    if signalled:
        faults += interrupted(ran, sent, moment)
    faults += kept(folder, kind, ran.err)
    time.sleep(0.3)
    faults += [f"process {one} is left behind" for one in left_behind(mark)]
    word = "signalled too late" if not signalled else outcome(ran.code) if ran.code >= 0 else "killed"
    name = f"{kind}, {sent.name}"
    return {"kind": name, "outcome": word, "seconds": seconds, "moment": moment, "faults": faults}


def before_airrace(ran: Ran) -> bool:
    """Whether Python was interrupted while it loaded itself, before it had read a line of airrace."""
    return ran.code != 0 and "KeyboardInterrupt" in ran.err and str(Path(airrace.__file__).parent) not in ran.err


def interrupted(ran: Ran, sent: signal.Signals, moment: float) -> list[str]:
    """What the end of a command that was signalled lacks."""
    if ran.code == 0 or (sent is signal.SIGKILL and ran.code == CODES[sent]):
        return []  # it was done already
    faults = [] if ran.code == CODES[sent] else [f"code {ran.code} after {sent.name} at {moment:.2f} s"]
    told = [line for line in ran.err.splitlines() if line.startswith("airrace: ")]
    # Until Python has read its first module of airrace, nobody listens.
    if ran.code in (-signal.SIGTERM, -signal.SIGINT) and not told and moment < 0.3:
        return []
    return faults + ([] if len(told) == 1 else [f"{len(told)} messages: {' / '.join(told)[:200]}"])


def kept(folder: Path, kind: str, err: str) -> list[str]:
    """Stages that were announced and are not in the checkpoint, and checkpoints that cannot be read."""
    path = {"resume": folder / "old.h5", "verify": folder / "old.h5", "export": folder / "old.h5"}.get(
        kind, folder / "run.h5"
    )
    if kind == "batch":
        return []
    lost = set(ANNOUNCED.findall(err)) - stored(path, folder) if "optimize" in kind or kind == "resume" else set[str]()
    unread = path.exists() and run("show", path.name, folder=folder).code != 0
    return [f"announced and not stored: {one}" for one in sorted(lost)] + (["cannot be read"] if unread else [])


def main() -> int:
    parser = options(__doc__ or "", 60)
    names = [one.name for one in SIGNALS]
    parser.add_argument("--signals", nargs="+", choices=names, default=names, help="those that are sent")
    arguments = parser.parse_args()
    signals = [signal.Signals[name] for name in arguments.signals]
    study = Study(arguments.seed, arguments.log)
    study.play(arguments.count, partial(trial, signals=signals), arguments.part)
    return study.report()


if __name__ == "__main__":
    sys.exit(main())
