"""Measure the engine beside other tools of optimal control, on the same race with the same limits and the same guess.

    pip install -e ".[peers]"
    python scripts/benchmark_peers.py [--laps 2] [--segments 10 20] [--repeats 3] [--markdown] [--figure FILE.png]

The race is a point mass through point gates, by default two laps of eight phases (scripts/peers/race.py). It is solved
by airrace's engine with several of its integration schemes, by ASSET and by rockit with IPOPT, each with one thread,
from the same guess, with equal segments in every phase and controls held over each. Without `--segments` and
`--repeats` a tool is measured on the meshes, and as often, as its entry in `TOOLS` says. Every answer is flown again
phase by phase by scipy's DOP853: the position error is how far the worst phase ends from where the tool believes. The
race time is compared with that of the engine, with the scheme of order 7, on a finer mesh (`--reference`). Seconds are
medians; processor seconds are told beside those of the clock, which mean little on a busy machine. Compiled kernels of
the engine come from its cache. A tool that is not installed is left out.
"""

import argparse
import contextlib
import importlib.util
import os
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from peers import asset, engine, rockit_meco
from peers.measured import Answer, position_error
from peers.race import Race, the_race

from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5, RK4_TWICE, VERNER_7, RungeKutta

Solve = Callable[[Race, int, float], Answer]
HEADINGS = ("tool", "segments", "iterations", "position error mm", "race time s", "its error ms")
HEADINGS += ("set-up s", "solve s", "set-up and solve, processor s", "solve, processor s")


@dataclass(frozen=True)
class Tool:
    """Something that solves the race.

    Attributes:
        name: in tables.
        solve: from race, segments per phase and tolerance to its answer.
        module: the package that it needs; empty for none.
        distribution: how that package is called where it is installed from.
        segments: per phase, of the meshes on which it is measured unless told otherwise.
        repeats: how often it is measured unless told otherwise.
    """

    name: str
    solve: Solve
    module: str = ""
    distribution: str = ""
    segments: tuple[int, ...] = (10, 20, 40)
    repeats: int = 3

    @property
    def missing(self) -> str:
        """A sentence if the tool is not installed; empty if it is."""
        if not self.module or importlib.util.find_spec(self.module) is not None:
            return ""
        return f"{self.name} is left out, for {self.distribution} is not installed (extra `peers`)."


@dataclass(frozen=True)
class Row:
    """The answers of one tool on one mesh, and their errors; NaN where it did not converge."""

    tool: str
    segments: int
    answers: tuple[Answer, ...]
    position_error: float
    race_time: float

    def median(self, of: Callable[[Answer], float]) -> float:
        """Of all repeats."""
        return statistics.median(of(answer) for answer in self.answers)

    def cells(self, reference: float) -> tuple[str, ...]:
        """As the table has them."""
        seconds = (lambda a: a.setup, lambda a: a.solve, lambda a: a.processor, lambda a: a.processor_solve)
        first = (self.tool, str(self.segments), str(self.answers[-1].iterations))
        if self.answers[-1].flight is None:
            errors: tuple[str, ...] = ("not converged", "", "")
        else:
            errors = (f"{float(f'{1e3 * self.position_error:.2g}'):g}", f"{self.race_time:.4f}")
            errors += (f"{1e3 * (self.race_time - reference):+.1f}",)
        return (*first, *errors, *(f"{self.median(one):.2f}" for one in seconds))


def with_scheme(scheme: RungeKutta) -> Solve:
    """airrace's engine with one of its schemes."""

    def solve(race: Race, segments: int, tolerance: float) -> Answer:
        return engine.solve(race, segments, scheme, tolerance)

    return solve


SCHEMES = (RK4_TWICE, DORMAND_PRINCE_5, VERNER_7)
TOOLS = (
    *(Tool(f"airrace, {scheme.name}", with_scheme(scheme)) for scheme in SCHEMES),
    Tool("ASSET, LGL5", asset.solve, "asset_asrl", "asset-asrl"),
    # Of a race of sixteen phases it takes minutes.
    Tool("rockit, IPOPT, rk4x2", rockit_meco.solve, "rockit", "rockit-meco", segments=(10, 20), repeats=1),
)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Whatever solvers print, in whichever language, goes nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def measure(race: Race, tool: Tool, segments: int, repeats: int, tolerance: float) -> Row:
    """Solve so many times; a tool that does not converge is not asked again."""
    answers: list[Answer] = []
    for _ in range(repeats):
        with quiet():
            answers.append(tool.solve(race, segments, tolerance))
        if answers[-1].flight is None:
            break
    flight = answers[-1].flight
    if flight is None:
        return Row(tool.name, segments, tuple(answers), float("nan"), float("nan"))
    return Row(tool.name, segments, tuple(answers), position_error(race, flight), flight.race_time)


def table(rows: Sequence[Row], reference: float, *, markdown: bool) -> Iterator[str]:
    """Lines of the table."""
    lines = [HEADINGS, *(row.cells(reference) for row in rows)]
    if markdown:
        lines.insert(1, ("---",) + ("---:",) * (len(HEADINGS) - 1))
        yield from (f"| {' | '.join(line)} |" for line in lines)
        return
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    yield from ("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, draw; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [tool.name for tool in TOOLS]
    parser.add_argument("--tools", nargs="+", choices=names, default=names, metavar="TOOL", help="; ".join(names))
    parser.add_argument("--laps", type=int, default=2, help="of eight phases each")
    parser.add_argument("--segments", type=int, nargs="+", help="per phase; otherwise each tool's own")
    parser.add_argument("--repeats", type=int, help="otherwise each tool's own")
    parser.add_argument("--tolerance", type=float, default=1e-6, help="of every solver, on its own scaled conditions")
    parser.add_argument("--reference", type=int, default=80, help="segments per phase of the race time compared with")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw it; needs matplotlib")
    chosen = parser.parse_args(arguments)
    for variable in ("OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # libraries read them when they are loaded, by `solve`
        os.environ.setdefault(variable, "1")
    race, rows = the_race(chosen.laps), list[Row]()
    tools = [tool for tool in TOOLS if tool.name in chosen.tools]
    for tool in tools:
        if tool.missing:
            print(tool.missing, file=sys.stderr)
    compared = measure(race, Tool("reference", with_scheme(VERNER_7)), chosen.reference, 1, chosen.tolerance)
    print(f"compared with {compared.race_time:.4f} s on {chosen.reference} segments per phase", file=sys.stderr)
    for tool in tools:
        for segments in () if tool.missing else chosen.segments or tool.segments:
            rows.append(measure(race, tool, segments, chosen.repeats or tool.repeats, chosen.tolerance))
            print(*rows[-1].cells(compared.race_time), sep="  ", file=sys.stderr, flush=True)
    for line in table(rows, compared.race_time, markdown=chosen.markdown):
        print(line)
    if chosen.figure:
        from peers.figure import draw  # needs matplotlib

        draw(rows, compared.race_time, chosen.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
