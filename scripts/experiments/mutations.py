"""Mutated documents, checkpoints and logs: read with one sentence or not at all, never with a traceback.

    python scripts/experiments/mutations.py [--count N] [--seed SEED] [--log FILE] [--part K/N] [--only KIND] [--verified N]

Documents and checkpoints are read in this process; what is accepted is shown and exported, too, and one in N of these
checkpoints is verified. Logs are those of the optimum of a course, in three formats; what is accepted is shown.
"""

import random
import re
import sys
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import h5py
import numpy as np
from robustness import ROOT, SMALL, Ran, Record, Study, choice_of, inside, options, outcome, peak_memory

from airrace.files.checkpoint.store import seal, unseal

LONGEST = 5.0  # s
MEMORY = 1024.0  # MB
LONGEST_LOG, LOG_MEMORY = 10.0, 500.0  # s, MB
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
KINDS = ("documents", "checkpoints", "logs")
LOGGED = "rovinj_2014"
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


def numbers(rng: random.Random, text: str) -> str:
    """Replace some numbers, most of them by others of the same kind."""
    found = list(re.finditer(r"-?\d+\.?\d*", text))
    for one in sorted(rng.sample(found, min(len(found), rng.randint(1, 20))), key=lambda one: -one.start()):
        digits = "".join(rng.choice("0123456789") if each.isdigit() else each for each in one[0])
        other = rng.choice((digits, digits, f"{one[0]}{rng.choice('0123456789')}", rng.choice(NUMBERS)))
        text = text[: one.start()] + other + text[one.end() :]
    return text


@cache
def sound_logs() -> dict[str, str]:
    """The optimum of a course as logs, by format."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.h5"
        ran = inside("optimize", LOGGED, "--until", "point-mass", "--search", "off", "--output", run, "--quiet")
        assert ran.code == 0, ran.err
        found: dict[str, str] = {}
        for form in ("csv", "gpx", "acmi"):
            path = Path(folder) / f"log.{form}"
            ran = inside("export", form, run, "--output", path)
            assert ran.code == 0, ran.err
            found[form] = path.read_text(encoding="utf-8")
        return found


def log(rng: random.Random, folder: Path) -> tuple[str, Ran]:
    form = rng.choice(sorted(sound_logs()))
    name, mutate = choice_of(rng, {"characters": characters, "lines": lines, "numbers": numbers, "bytes": characters})
    content = bytearray(mutate(rng, sound_logs()[form]).encode("utf-8", "surrogateescape"))
    if name == "bytes":
        for _ in range(rng.randint(1, 8)):
            content[rng.randrange(len(content))] = rng.randrange(256)
        content = content[: rng.choice((len(content), rng.randrange(len(content))))]
    path, flight = folder / f"log.{form}", folder / "flight.h5"
    path.write_bytes(bytes(content))
    ran = inside("import", path, "--course", LOGGED, "--output", flight)
    if ran.code == 0:
        ran = inside("show", flight, "--no-verify")
    return f"log, {form}, {name}", ran


def trial(rng: random.Random, number: int, only: str | None, verified_every: int) -> Record:
    """A third of the trials are documents, checkpoints and logs each. Or all are of one kind."""
    kind = only or rng.choice(KINDS)
    plays: dict[str, Callable[[random.Random, Path], tuple[str, Ran]]] = {
        "documents": document,
        "checkpoints": lambda rng, folder: checkpoint(rng, folder, verified_every),
        "logs": log,
    }
    longest, most = (LONGEST_LOG, LOG_MEMORY) if kind == "logs" else (LONGEST, MEMORY)
    with tempfile.TemporaryDirectory() as folder:
        what, ran = plays[kind](rng, Path(folder))
    faults = ran.faults(longest)
    if (peak := peak_memory()) > most:
        faults.append(f"{peak:.0f} MB of memory")
    return {"kind": what, "outcome": outcome(ran.code), "seconds": ran.seconds, "faults": faults}


def main() -> int:
    parser = options(__doc__ or "", 400)
    parser.add_argument("--only", choices=KINDS, help="trials of this kind alone")
    parser.add_argument("--verified", type=int, default=40, metavar="N", help="one in N accepted checkpoints")
    arguments = parser.parse_args()
    study = Study(arguments.seed, arguments.log)
    study.play(arguments.count, partial(trial, only=arguments.only, verified_every=arguments.verified), arguments.part)
    print(f"peak memory {peak_memory():.0f} MB")
    return study.report()


if __name__ == "__main__":
    sys.exit(main())
