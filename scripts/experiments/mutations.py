"""Mutated documents and checkpoints: read with one sentence or not at all, never with a traceback.

    python scripts/experiments/mutations.py [--count N] [--seed SEED] [--log FILE] [--part K/N] [--only KIND] [--verified N]

Documents and checkpoints are read in this process; what is accepted is shown and exported, too, and one in N of these
checkpoints is verified.
"""

import random
import sys
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import h5py
import numpy as np
from robustness import ROOT, SMALL, Ran, Record, Study, choice_of, inside, options, outcome, peak_memory

from airrace.checkpoint.store import seal, unseal

LONGEST = 5.0  # s
MEMORY = 1024.0  # MB
NUMBERS = (
    "nan",
    ".inf",
    "-1",
    "0",
    "1e308",
    "1e-308",
    "true",
    "null",
    "''",
    "[]",
    "{}",
    "0x1f",
    "2026-01-01",
    "999999",
)
VALUES = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e29, 1e31, 1e200, 1e-300)
BATCH = "schema: airrace/batch/1\ncourses: [a.yaml]\nsweep:\n  rules.n_z_max: [10, 11]\nuntil: point-mass\n"
SETTINGS = "schema: airrace/settings/1\nsearch: off\nguess: plan\n"


def characters(rng: random.Random, text: str) -> str:
    for _ in range(rng.randint(1, 5)):
        place = rng.randrange(len(text))
        text = text[:place] + rng.choice("\t\0\n :-#{}[]&*!|>'\"%@`é\x1b\u202e" + text[place]) + text[place + 1 :]
    return text


def lines(rng: random.Random, text: str) -> str:
    every = text.splitlines(keepends=True)
    for _ in range(rng.randint(1, 3)):
        one, other = rng.randrange(len(every)), rng.randrange(len(every))
        match rng.randrange(4):
            case 0:
                every[one], every[other] = every[other], every[one]
            case 1:
                every.insert(one, every[other])
            case 2 if len(every) > 1:
                del every[one]
            case _:
                every[one] = " " * rng.randint(1, 4) + every[one]
    return "".join(every)


def values(rng: random.Random, text: str) -> str:
    every = text.splitlines()
    with_value = [row for row, line in enumerate(every) if ": " in line]
    for row in rng.sample(with_value, min(len(with_value), rng.randint(1, 3))):
        every[row] = f"{every[row].split(': ')[0]}: {rng.choice(NUMBERS)}"
    return "\n".join(every) + "\n"


def nested(rng: random.Random, text: str) -> str:
    depth = rng.choice((10, 100, 5000))
    return text + rng.choice(
        (f"more: {'[' * depth}\n", f"more: {'{a: ' * depth}\n", "gates: &a [*a]\n", "x: 1\n" * 999)
    )


TEXTS: dict[str, Callable[[random.Random, str], str]] = {
    "characters": characters,
    "lines": lines,
    "values": values,
    "nested": nested,
}


@cache
def sound() -> tuple[bytes, float]:
    """A checkpoint of the small course, and the seconds that it takes to verify it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        ran = inside("optimize", *SMALL, "--output", path, "--quiet")
        assert ran.code == 0, ran.err
        return path.read_bytes(), max(inside("verify", path).seconds for _ in range(2))


def document(rng: random.Random, folder: Path) -> tuple[str, Ran]:
    name, mutate = choice_of(rng, TEXTS)
    track, aircraft = folder / "a.yaml", folder / "edge540.yaml"
    track.write_bytes((ROOT / "tracks" / "half_cuban_eight.yaml").read_bytes())
    aircraft.write_bytes((ROOT / "configs" / "edge540.yaml").read_bytes())
    kind = rng.choice(("track", "aircraft", "settings", "batch"))
    target = {"track": track, "aircraft": aircraft}.get(kind, folder / f"{kind}.yaml")
    text = {"settings": SETTINGS, "batch": BATCH}.get(kind) or target.read_text(encoding="utf-8")
    target.write_bytes(mutate(rng, text).encode("utf-8", "surrogateescape"))
    dry = ("--dry-run", "--output", folder / "batch")
    commands = {
        "track": ("check", track),
        "aircraft": ("batch", track, "--aircraft", aircraft, *dry),
        "settings": ("batch", track, "--settings", target, *dry),
        "batch": ("batch", target, *dry),
    }
    return f"{kind}, {name}", inside(*commands[kind])


def spoilt_numbers(rng: random.Random, image: Path) -> None:
    """Change numbers and rows of datasets as someone would who knows HDF5."""
    with h5py.File(image, "r+") as file:
        names: list[str] = []
        file.visititems(lambda name, node: names.append(name) if isinstance(node, h5py.Dataset) and node.size else None)
        for name in rng.sample(names, rng.randint(1, 3)):
            node = file[name]
            if node.dtype.kind == "f":
                content = node[...]
                content.flat[rng.randrange(content.size)] = rng.choice(VALUES)
                content *= rng.choice((1.0, 1.0, 1e3, -1.0))
                node[...] = content
            elif node.dtype.names:
                row = rng.randrange(len(node))
                column = rng.choice(node.dtype.names)
                if node.dtype[column].kind == "f":
                    node[row, column] = rng.choice(VALUES)
            elif node.dtype.kind == "i":
                node[...] = np.roll(node[...], 1)


def checkpoint(rng: random.Random, folder: Path, verified_every: int) -> tuple[str, Ran]:
    """Half of the files are sealed again; what is accepted goes through all readers, now and then through `verify`."""
    whole, verified_in = sound()
    path = folder / "run.h5"
    resealed = rng.random() < 0.5
    if resealed:
        path.write_bytes(unseal(whole))
        spoilt_numbers(rng, path)
        path.write_bytes(seal(path.read_bytes()))
    else:
        content = bytearray(whole)
        for _ in range(rng.randint(1, 8)):
            content[rng.randrange(len(content))] = rng.randrange(256)
        path.write_bytes(bytes(content[: rng.choice((len(content), rng.randrange(len(content))))]))
    kind = "checkpoint, resealed" if resealed else "checkpoint, bytes"
    readers = [("show", path, "--legs")]
    readers.append(("export", "csv", path, "--output", folder / "out.csv"))
    readers += [
        ("export", suffix, path, "--origin", "45,15,0", "--output", folder / f"out.{suffix}")
        for suffix in ("acmi", "kml")
    ]
    worst = inside("show", path)
    if worst.code != 0:
        return kind, worst
    for reader in readers:
        ran = inside(*reader)
        if ran.faults(LONGEST) or ran.code == 2:
            return f"{kind}, {' '.join(map(str, reader[:2]))}", ran
    if rng.randrange(verified_every) == 0:
        ran = inside("verify", path)
        if ran.faults(3.0 * verified_in):
            return f"{kind}, verify", ran
        kind += ", verified"
    return kind, worst


def trial(rng: random.Random, number: int, only: str | None, verified_every: int) -> Record:
    """Half of the trials are documents, half checkpoints. Or all are of one kind."""
    kind = only or rng.choice(("documents", "checkpoints"))
    plays: dict[str, Callable[[random.Random, Path], tuple[str, Ran]]] = {
        "documents": document,
        "checkpoints": lambda rng, folder: checkpoint(rng, folder, verified_every),
    }
    with tempfile.TemporaryDirectory() as folder:
        what, ran = plays[kind](rng, Path(folder))
    faults = ran.faults(LONGEST)
    if (peak := peak_memory()) > MEMORY:
        faults.append(f"{peak:.0f} MB of memory")
    return {"kind": what, "outcome": outcome(ran.code), "seconds": ran.seconds, "faults": faults}


def main() -> int:
    parser = options(__doc__ or "", 400)
    parser.add_argument("--only", choices=("documents", "checkpoints"), help="trials of this kind alone")
    parser.add_argument("--verified", type=int, default=40, metavar="N", help="one in N accepted checkpoints")
    arguments = parser.parse_args()
    study = Study(arguments.seed, arguments.log)
    study.play(arguments.count, partial(trial, only=arguments.only, verified_every=arguments.verified), arguments.part)
    print(f"peak memory {peak_memory():.0f} MB")
    return study.report()


if __name__ == "__main__":
    sys.exit(main())
