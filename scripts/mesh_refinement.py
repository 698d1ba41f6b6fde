"""Hold refined meshes against uniform ones: what accuracy they reach with how many nodes, and in how many seconds.

    python scripts/mesh_refinement.py [TRACK.yaml ...] [--stage point-mass] [--chains] [--markdown] [--figure FILE.png]

Every course is flown by the procedure itself, from the plan, and every mesh that it solves on is measured: the refined
chain. From the optimum on its first mesh it is also flown on uniform meshes, of equal intervals in each phase, from
0.17 s down to 0.015 s in steps of the root of two, each solved from the one before (0.24 s and 0.34 s likewise, the
other way). The race time to compare with is that of the refined mesh with all intervals halved twice more. Between the
first uniform mesh that is as accurate as the refined one and the one before, two more are solved: 9 % are left.

Seconds are those in the solver, with one thread, up to and with a mesh: those before it have to be solved, too. The
last column, at best, leaves out the uniform meshes before: as if this one were solved as fast straight from the first
one of the procedure, by somebody who knows beforehand how fine it has to be.

Ends with 1 unless the refined mesh has at most 70 % of the nodes of the smallest uniform one that is as accurate, in
race time, in the Hamiltonian and in both, on at least three courses (on all, where fewer are given). The replay is told
as well; the procedure makes a mesh no finer for it than its limit asks.
"""

import argparse
import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path

from mesh_comparison import MEASURES, Comparison, Measured, compared

from airrace.errors import AirraceError
from airrace.inputs import load_inputs
from airrace.procedure.stage import STAGES, Stage

ROOT = Path(__file__).resolve().parent.parent
NAMES = ("rovinj_2014", "gdynia_2014", "sixteen_phases", "chiba_2015")
SHARE = 0.70  # of the nodes of a uniform mesh
ENOUGH = 3  # courses
DECISIVE = ("race time", "Hamiltonian", "both")

Table = tuple[tuple[str, ...], list[tuple[str, ...]]]


def chains_table(courses: Sequence[Comparison]) -> Table:
    """One line per mesh."""
    headings = ("course", "mesh", "nodes", "race time s", "error ms", "drift", "defect", "solver s", "cumulated s")
    rows: list[tuple[str, ...]] = []
    for course in courses:
        named = [(f"refined {number}", one) for number, one in enumerate(course.refined)]
        named += [(f"halved {2**number} times as fine", one) for number, one in enumerate(course.halved, start=1)]
        named += [(f"uniform {one.spacing:.3f} s", one) for one in course.uniform]
        for label, one in named:
            cells = (f"{one.race_time:.6f}", f"{1e3 * course.error(one):.3f}", f"{one.drift:.4f}", f"{one.defect:.1e}")
            rows.append((course.name, label, str(one.nodes), *cells, f"{one.seconds:.2f}", f"{one.cumulated:.2f}"))
    return headings, rows


def comparison_table(courses: Sequence[Comparison]) -> Table:
    """One line per course and measure."""
    headings = ("course", "nodes", "error ms", "drift", "defect", "solver s", "as accurate in", "uniform nodes")
    headings += ("share of nodes", "its error ms", "its drift", "its defect", "its solver s", "share of seconds")
    headings += ("at best s",)
    rows: list[tuple[str, ...]] = []
    for course in courses:
        for measure in MEASURES:
            about = (course.name, str(course.answer.nodes), *accuracy(course, course.answer))
            if measure != next(iter(MEASURES)):
                about = ("",) * 6
            rows.append((*about, measure, *found(course, measure)))
    return headings, rows


def found(course: Comparison, measure: str) -> tuple[str, ...]:
    """Cells on the smallest uniform mesh that is as accurate; the finest, if none is."""
    first = course.as_accurate(measure)
    one = first or course.uniform[-1]
    less, more = ("", "") if first is not None else ("< ", "> ")
    nodes = (f"{more}{one.nodes}", f"{less}{course.share(measure):.2f}")
    seconds = (
        f"{less}{course.answer.cumulated / one.cumulated:.2f}",
        f"{course.refined[0].cumulated + one.seconds:.1f}",
    )
    return (*nodes, *accuracy(course, one), *seconds)


def accuracy(course: Comparison, one: Measured) -> tuple[str, ...]:
    """Cells: error, drift, defect, seconds."""
    return f"{1e3 * course.error(one):.2f}", f"{one.drift:.4f}", f"{one.defect:.0e}", f"{one.cumulated:.1f}"


def printed(table: Table, *, markdown: bool) -> None:
    """In columns, or as Markdown; words flush left, numbers right."""
    headings, rows = table
    words = {"course", "mesh", "as accurate in"}
    if markdown:
        rule = tuple("---" if heading in words else "---:" for heading in headings)
        for line in (headings, rule, *rows):
            print(f"| {' | '.join(line)} |")
        return
    widths = [max(len(line[column]) for line in (headings, *rows)) for column in range(len(headings))]
    for line in (headings, *rows):
        cells = zip(headings, line, widths, strict=True)
        print("  ".join(cell.ljust(n) if name in words else cell.rjust(n) for name, cell, n in cells).rstrip())


def checked(course: Comparison) -> str:
    """The race time compared with, and whether the finest uniform mesh would tell another story."""
    finest = course.uniform[-1]
    other = dataclasses.replace(course, reference=finest.race_time).share("race time")
    return (
        f"{course.name}: compared with {course.reference:.5f} s on {course.halved[-1].nodes} nodes, moved by "
        f"{1e3 * course.uncertainty:.2f} ms in the last halving; the finest uniform mesh has {finest.race_time:.5f} s "
        f"on {finest.nodes}; compared with that, the share of nodes in race time is {other:.2f}"
    )


def verdict(courses: Sequence[Comparison], wanted: int) -> bool:
    """Whether refining saves enough nodes; prints how many courses say so, by measure."""
    good = {measure: sum(one.share(measure) <= SHARE for one in courses) for measure in MEASURES}
    for measure, count in good.items():
        print(f"at most {SHARE:.0%} of the nodes, as accurate in {measure}: {count} of {wanted} courses")
    return all(good[measure] >= min(ENOUGH, wanted) for measure in DECISIVE)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, draw; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tracks = [ROOT / "tracks" / f"{name}.yaml" for name in NAMES]
    parser.add_argument("tracks", nargs="*", type=Path, default=tracks, metavar="TRACK.yaml", help="; ".join(NAMES))
    stages = [stage.value for stage in STAGES if stage is not Stage.HOMOTOPY]
    parser.add_argument("--stage", choices=stages, default=Stage.POINT_MASS.value, help="by default point-mass")
    parser.add_argument("--chains", action="store_true", help="a table of all meshes, too")
    parser.add_argument("--markdown", action="store_true", help="tables as Markdown")
    parser.add_argument("--figure", type=Path, metavar="FILE.png", help="draw it; needs matplotlib")
    chosen = parser.parse_args(arguments)
    courses: list[Comparison] = []
    for track in chosen.tracks:
        try:
            inputs = load_inputs(track)
            courses.append(compared(track.stem, inputs.race, inputs.settings, Stage(chosen.stage)))
        except AirraceError as error:
            print(f"{track.stem}: {error}", file=sys.stderr)
    if not courses:
        return 1
    if chosen.chains:
        printed(chains_table(courses), markdown=chosen.markdown)
        print()
    printed(comparison_table(courses), markdown=chosen.markdown)
    print()
    for one in courses:
        print(checked(one))
    if chosen.figure:
        from mesh_refinement_figure import draw  # needs matplotlib

        draw(courses, chosen.figure)
    return 0 if verdict(courses, len(chosen.tracks)) else 1


if __name__ == "__main__":
    sys.exit(main())
