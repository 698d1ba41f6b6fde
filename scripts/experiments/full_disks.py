"""A disk that is full at a random byte: one sentence, code 8, and nothing old is destroyed.

    python scripts/experiments/full_disks.py [--count N] [--seed SEED] [--log FILE]

The disk is a limit of the size of files (RLIMIT_FSIZE): the system refuses the byte after it, as a full disk does.
"""

import hashlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

from robustness import COMMAND, SMALL, Ran, Record, choice_of, environment, outcome, play_study

LONGEST = 60.0  # s
ORIGIN = ("--origin", "45,15,0")
COMMANDS: dict[str, tuple[str, ...]] = {
    "checkpoint": ("optimize", *SMALL, "--output", "old.h5", "--force"),
    "resume": ("resume", "old.h5", "--until", "transfer-function"),
    "csv": ("export", "csv", "old.h5", "--output", "old.out", "--force"),
    "kml": ("export", "kml", "old.h5", *ORIGIN, "--output", "old.out", "--force"),
    "acmi": ("export", "acmi", "old.h5", *ORIGIN, "--output", "old.out", "--force"),
    "report": ("report", "old.h5", "--output", "old.out", "--force"),
    "new": ("optimize", *SMALL, "--output", "new.h5"),
    "batch": ("batch", "half_cuban_eight", "--until", "point-mass", "--set", "settings.guess=plan", "--output", "b"),
    "stdout": ("show", "old.h5"),
}
OLD = b"what was written before\n"


@cache
def checkpoint() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        command = [*COMMAND, "optimize", *SMALL, "--output", "run.h5", "--quiet"]
        subprocess.run(command, cwd=folder, env=environment(), check=True)
        return (Path(folder) / "run.h5").read_bytes()


def limited(size: int) -> None:
    """Refuse files beyond a size in this process and its children, with an error in the place of a signal."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def trial(rng: random.Random, number: int) -> Record:
    kind, command = choice_of(rng, COMMANDS)
    size = rng.choice((0, 100, rng.randrange(20_000), rng.randrange(300_000)))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "old.h5").write_bytes(checkpoint())
        (folder / "old.out").write_bytes(OLD)
        before = digests(folder)
        began = time.monotonic()
        with Path("/dev/full").open("w") as full:
            ended = subprocess.run(
                [*COMMAND, *command],
                cwd=folder,
                env=environment(),
                stdout=full if kind == "stdout" else subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                timeout=LONGEST,
                check=False,
                preexec_fn=lambda: limited(size),
            )
        ran = Ran(ended.returncode, ended.stdout or "", ended.stderr, time.monotonic() - began)
        faults = ran.faults(LONGEST)
        if ran.code not in (0, 8):
            faults.append(f"code {ran.code}: {ran.err.strip()[-160:]}")
        told = [line for line in ran.err.splitlines() if line.startswith("airrace: ") and ": warning: " not in line]
        if ran.code == 8:
            faults += [] if len(told) == 1 else [f"{len(told)} sentences: {' / '.join(told)[:200]}"]
            faults += [f"{one} is not what it was" for one, digest in before.items() if digests(folder)[one] != digest]
            faults += [f"{one.name} is left behind" for one in folder.iterdir() if one.name not in KNOWN]
    return {"kind": kind, "outcome": outcome(ran.code), "size": size, "seconds": ran.seconds, "faults": faults}


KNOWN = ("old.h5", "old.out", "new.h5", "b")


def digests(folder: Path) -> dict[str, str]:
    """The sha256 of what lies there from the start; empty where it is gone."""
    files = (folder / "old.h5", folder / "old.out")
    return {one.name: hashlib.sha256(one.read_bytes()).hexdigest() if one.exists() else "" for one in files}


if __name__ == "__main__":
    sys.exit(play_study(__doc__ or "", 60, trial))
