"""Solve all problems with known answers, and hold the optima against them.

    python tests/validation/known_answers.py [--markdown]           ours, published, difference
    python tests/validation/known_answers.py --refine [--markdown]  on meshes twice and four times as fine
    python tests/validation/known_answers.py --orders [--markdown]  orders of convergence of every integrator
    python tests/validation/known_answers.py --solvers [--markdown] iterations and seconds, ours and IPOPT's

`tests/validation/` states the problems, a module each. Seconds are those in the solver, without compiled
kernels. Ends with 1 if a problem is not solved, a value lies outside its tolerance or an order is not what theory says.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from convergence import SCHEMES, integration_errors, observed_order, optimum_errors, order_of_optima
from statement import KnownAnswer, Value
from textbook import known_answers, refinements

from airrace.optimal_control.problem import Problem
from airrace.optimal_control.solvers import INTERIOR_POINT, IPOPT
from airrace.optimal_control.solvers.solver import ProgramSolution

REFINEMENTS = 2
ORDER_TOLERANCE = 0.2


@dataclass(frozen=True)
class Row:
    """Cells of one line of a table, and whether what it says is as it should be."""

    cells: tuple[str, ...]
    holds: bool


@dataclass(frozen=True)
class Table:
    """`numeric` are the columns that are set flush right."""

    headings: tuple[str, ...]
    numeric: tuple[int, ...]
    rows: Iterable[Row]


def answers_table() -> Table:
    """One line per known value."""
    headings = (
        *("problem", "optimum", "ours", "published", "unit", "source", "difference", "in last digits", "intervals"),
        *("scheme", "solver s", "iterations"),
    )
    rows = (row for answer in known_answers() for row in answer_rows(answer, answer.solve()))
    return Table(headings, (2, 3, 6, 7, 10, 11), rows)


def answer_rows(answer: KnownAnswer, solution: ProgramSolution) -> Iterable[Row]:
    """Of one problem; what is said of the whole solution stands in the first of them."""
    about = (mesh(answer.problem), answer.problem.scheme.name, f"{solution.seconds:.2f}", str(solution.iterations))
    for index, value in enumerate(answer.values):
        ours = value.of(solution)
        difference = ours - float(value.published)
        cells = (value.name, number(value, ours), value.published, value.unit, value.source)
        cells += (f"{difference:+.1e}", "" if value.closed_form else f"{difference / last_digit(value):+.2f}")
        cells += about if index == 0 else ("",) * len(about)
        holds = solution.success and abs(difference) <= value.tolerance
        yield Row((answer.name if index == 0 else "", *cells), holds)


def mesh(problem: Problem) -> str:
    """Intervals of every phase."""
    counts = [len(phase.fractions) for phase in problem.phases]
    if len(counts) > 1 and len(set(counts)) == 1:
        return f"{len(counts)} x {counts[0]}"
    return " + ".join(map(str, counts))


def decimals(value: Value) -> int:
    """Digits of the published number behind its point."""
    return len(value.published.partition(".")[2])


def last_digit(value: Value) -> float:
    """What one unit of the last published digit is worth."""
    return 10.0 ** -decimals(value)


def number(value: Value, ours: float) -> str:
    """Ours, with two digits more than are published."""
    return f"{ours:.{decimals(value) if value.closed_form else decimals(value) + 2}f}"


def refinement_table() -> Table:
    """One line per mesh of every problem that has no closed form."""

    def rows() -> Iterable[Row]:
        for answer in known_answers():
            value = answer.values[0]
            if value.closed_form:
                continue
            for level, (finer, solution) in enumerate(refinements(answer, REFINEMENTS)):
                ours = value.of(solution)
                difference = ours - float(value.published)
                cells = (answer.name if level == 0 else "", mesh(finer.problem), number(value, ours), value.published)
                cells += (value.unit, f"{difference / last_digit(value):+.2f}", f"{solution.seconds:.2f}")
                holds = solution.success and abs(difference) <= value.tolerance
                yield Row((*cells, str(solution.iterations)), holds)

    headings = ("problem", "intervals", "ours", "published", "unit", "in last digits", "solver s", "iterations")
    return Table(headings, (2, 3, 5, 6, 7), rows())


def orders_table() -> Table:
    """One line per integrator."""

    def rows() -> Iterable[Row]:
        for scheme in SCHEMES:
            observed = [observed_order(errors, scheme) for errors in (integration_errors, optimum_errors)]
            expected = scheme.order, order_of_optima(scheme)
            cells = (scheme.name, str(len(scheme.b) * scheme.steps), str(scheme.order))
            holds = all(abs(seen - order) <= ORDER_TOLERANCE for seen, order in zip(observed, expected, strict=True))
            yield Row((*cells, *(f"{order:.2f}" for order in observed)), holds)

    headings = ("integrator", "stages", "theoretical order", "observed, by itself", "observed, of an optimum")
    return Table(headings, (1, 2, 3, 4), rows())


def solvers_table() -> Table:
    """One line per problem."""

    def rows() -> Iterable[Row]:
        for answer in known_answers():
            solutions = [answer.solve(solver) for solver in (INTERIOR_POINT, IPOPT)]
            iterations = [str(solution.iterations) if solution.success else "-" for solution in solutions]
            seconds = [f"{solution.seconds:.2f}" for solution in solutions]
            holds = all(solution.success for solution in solutions)
            yield Row((answer.name, mesh(answer.problem), *iterations, *seconds), holds)

    headings = ("problem", "intervals", "iterations", "of IPOPT", "solver s", "of IPOPT")
    return Table(headings, (2, 3, 4, 5), rows())


def print_text(table: Table) -> bool:
    """In columns; whether all rows hold."""
    rows = list(table.rows)
    lines = [(*table.headings, "holds"), *((*row.cells, "yes" if row.holds else "NO") for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    for line in lines:
        cells = (
            cell.rjust(width) if column in table.numeric else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        print("  ".join(cells).rstrip())
    return all(row.holds for row in rows)


def print_markdown(table: Table) -> bool:
    """As a table for a document; whether all rows hold, of which those that do not are told on stderr."""
    rows = list(table.rows)
    rule = ["---:" if column in table.numeric else "---" for column in range(len(table.headings))]
    for line in (table.headings, rule, *(row.cells for row in rows)):
        print(f"| {' | '.join(line)} |")
    for row in rows:
        if not row.holds:
            print(f"does not hold: {' '.join(row.cells)}", file=sys.stderr)
    return all(row.holds for row in rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--markdown", action="store_true", help="as Markdown")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--refine", action="store_true", help="the answers on finer meshes instead")
    which.add_argument("--orders", action="store_true", help="the orders of convergence instead")
    which.add_argument("--solvers", action="store_true", help="iterations of both solvers instead")
    chosen = parser.parse_args(arguments)
    table = answers_table()
    if chosen.orders:
        table = orders_table()
    elif chosen.refine:
        table = refinement_table()
    elif chosen.solvers:
        table = solvers_table()
    return 0 if (print_markdown if chosen.markdown else print_text)(table) else 1


if __name__ == "__main__":
    sys.exit(main())
