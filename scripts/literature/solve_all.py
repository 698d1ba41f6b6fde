"""Solve the problems of the literature by both solvers, and hold the optima against what is published.

    python scripts/literature/solve_all.py [--quick] [--markdown] [NAME ...]

The problems are those beside this file, a module each, and those with known answers in `tests/validation/`. Each is
solved on its own mesh; seconds are those in the solver, without compiled kernels. A row that does not hold says why:
the engine's own word, or the distance from what is published. Ends with 1 if there is one.
"""

import argparse
import importlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmark import Benchmark

from airrace.optimal_control import Solution

HERE = Path(__file__).parent
KNOWN_ANSWERS = HERE.parents[1] / "tests" / "validation"
TOOLS = {"benchmark", "solve_all"}
SOLVERS = ("interior-point", "ipopt")
HEADINGS = (
    *("problem", "kind", "intervals", "ours", "published", "error", "source"),
    *("iterations", "seconds", "IPOPT's iterations", "IPOPT's seconds", "holds"),
)
RIGHT = (2, 3, 4, 5, 7, 8, 9, 10)


def literature() -> tuple[Benchmark, ...]:
    """Return the problems beside this file, by the names of their modules."""
    modules = sorted(path.stem for path in HERE.glob("*.py") if path.stem not in TOOLS)
    return tuple(benchmark for module in modules for benchmark in importlib.import_module(module).benchmarks())


def known_answers() -> tuple[Benchmark, ...]:
    """Return the problems with known answers of the tests, each with its first value."""
    sys.path.insert(0, str(KNOWN_ANSWERS))
    answers: list[Benchmark] = []
    for answer in importlib.import_module("textbook").known_answers():
        value = answer.values[0]
        answers.append(
            Benchmark(
                name=answer.name,
                problem=answer.problem,
                published=value.published,
                source="" if value.closed_form else value.source,
                kind="multi-phase" if len(answer.problem.phases) > 1 else "known answer",
                guess=answer.guess,
                tolerance=value.tolerance,
                closed_form=value.closed_form,
                options=answer.options,
                of=value.of,
            )
        )
    return tuple(answers)


def row(benchmark: Benchmark) -> tuple[str, ...]:
    """Return the cells of a problem; the last is `yes`, or why it does not hold."""
    ours, ipopt = (benchmark.solve(solver) for solver in SOLVERS)
    digits = len(benchmark.published.partition(".")[2].partition("e")[0]) + 2
    form = f".{digits}e" if "e" in benchmark.published else f".{digits}f"
    return (
        benchmark.name,
        benchmark.kind,
        str(benchmark.problem.intervals),
        f"{benchmark.value(ours):{form}}",
        benchmark.published,
        f"{benchmark.error(ours):+.1e}",
        ", ".join(filter(None, (benchmark.source, "closed form" * benchmark.closed_form))),
        str(ours.iterations),
        f"{ours.seconds:.2f}",
        *((str(ipopt.iterations), f"{ipopt.seconds:.2f}") if ipopt.success else ("no optimum", f"{ipopt.seconds:.2f}")),
        reason(benchmark, ours),
    )


def reason(benchmark: Benchmark, solution: Solution) -> str:
    """Return `yes`, or why a solution is not the published optimum."""
    if not solution.success:
        return f"NO: {solution.status}"
    return "yes" if benchmark.holds(solution) else "NO: another optimum"


def rows(benchmarks: Sequence[Benchmark]) -> Iterator[tuple[str, ...]]:
    for benchmark in benchmarks:
        yield row(benchmark)
        print(f"{benchmark.name} is solved", file=sys.stderr)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="problems; all without one")
    parser.add_argument("--quick", action="store_true", help="those that are solved within seconds")
    parser.add_argument("--markdown", action="store_true", help="as Markdown")
    chosen = parser.parse_args(arguments)
    benchmarks = (*literature(), *known_answers())
    if unknown := set(chosen.names) - {benchmark.name for benchmark in benchmarks}:
        parser.error(
            f"no problem is called {', '.join(sorted(unknown))}; there are {', '.join(b.name for b in benchmarks)}"
        )
    wanted = [b for b in benchmarks if (b.quick or not chosen.quick) and (b.name in chosen.names or not chosen.names)]
    table = list(rows(wanted))
    if chosen.markdown:
        rules = tuple("---:" if column in RIGHT else "---" for column in range(len(HEADINGS)))
        print("\n".join(f"| {' | '.join(line)} |" for line in (HEADINGS, rules, *table)))
    else:
        widths = [max(len(line[column]) for line in (HEADINGS, *table)) for column in range(len(HEADINGS))]
        for line in (HEADINGS, *table):
            print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())
    return 0 if all(line[-1] == "yes" for line in table) else 1


if __name__ == "__main__":
    sys.exit(main())
