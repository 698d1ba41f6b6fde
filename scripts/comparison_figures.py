"""Draw the comparisons of the documents: what `airrace compare` says of pairs of flights. Needs matplotlib (`plot`).

    python scripts/comparison_figures.py [--output docs/figures] [--runs FOLDER] [--only compare_wind.png ...]

Every flight is a run of `airrace optimize` from the plan, with exploring. Checkpoints are kept in the folder of
`--runs`, and those that lie there already are not flown again. The tables of the comparisons are printed.
"""

import argparse
import io
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from airrace.cli.compare_tables import comparison_texts
from airrace.flights import Flight
from airrace.flights.comparison import compared
from airrace.runs.flight_sources import opened_flight
from airrace.views.comparison_figure import comparison_figure

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "figures"
COMMAND = (sys.executable, "-m", "airrace")
DOTS_PER_INCH = 85
SHADES = 48  # of the palette: enough for a drawing, and a third of the file


@dataclass(frozen=True)
class Flown:
    """A flight: what the drawing calls it, its checkpoint, its course, what differs from it, and its stage."""

    label: str
    run: str
    track: str
    options: tuple[str, ...] = ()
    stage: str = "point-mass"


def wind(degrees: int) -> tuple[str, ...]:
    """The options of 15 kt from a direction."""
    return "--set", f"environment.wind.from_deg={degrees}", "--set", "environment.wind.speed_kt=15"


NO_LINE = ("--set", "course.lap.4.safety_lines=null", "--set", "safety_lines=null")
"""The options that take the safety line of Abu Dhabi away, behind which the flat turn to gate 5 leads."""
ROVINJ, ABU_DHABI = "rovinj_2014", "abu_dhabi_2016"
FIGURES: dict[str, tuple[Flown, ...]] = {
    "compare_aircraft.png": (
        Flown("Edge 540", "rovinj", ROVINJ),
        Flown("PC-9", "rovinj_pc9", ROVINJ, ("--aircraft", "pc9")),
    ),
    "compare_wind.png": (
        Flown("15 kt from 240°", "rovinj_240", ROVINJ, wind(240)),
        Flown("15 kt from 280°", "rovinj_280", ROVINJ, wind(280)),
    ),
    "compare_fidelity.png": (
        Flown("point mass", "rovinj_six_dof", ROVINJ),
        Flown("six degrees of freedom", "rovinj_six_dof", ROVINJ, stage="six-dof"),
    ),
    "compare_ways.png": (
        Flown("over the top", "abu_dhabi", ABU_DHABI),
        Flown("flat, without the line", "abu_dhabi_flat", ABU_DHABI, NO_LINE),
    ),
}
"""The flights of every figure; the first one is what the others are held against."""


def flights_of(flown: Sequence[Flown], runs: Path) -> list[Flight]:
    """The flights under their labels; what is missing is flown up to the highest stage that is asked for.

    Raises:
        RuntimeError: a stage is neither certified nor solved.
    """
    for one in reversed(flown):
        run = runs / f"{one.run}.h5"
        if not run.exists():
            options = (*one.options, "--guess", "plan", "--until", one.stage, "--quiet", "--out", str(run))
            subprocess.run([*COMMAND, "optimize", one.track, *options], check=False)
    flights = [opened_flight(f"{runs / one.run}.h5:{one.stage}") for one in flown]
    for flight in flights:
        if not flight.source.certified and flight.source.remark:
            raise RuntimeError(f"{flight.label}: {flight.source.remark}")
    return [flight.labelled(one.label) for one, flight in zip(flown, flights, strict=True)]


def draw(flown: Sequence[Flown], runs: Path, path: Path) -> None:
    """Draw a comparison into a file with a small palette, and print its table."""
    reference, *others = flights_of(flown, runs)
    comparisons = [compared(reference, other) for other in others]
    for one in comparisons:
        print("\n".join(comparison_texts(one, every=False)))
    content = io.BytesIO()
    comparison_figure(comparisons).savefig(content, format="png", dpi=DOTS_PER_INCH)
    Image.open(content).convert("RGB").quantize(SHADES, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw the comparisons of the documents.")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="where to; docs/figures")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="where checkpoints are kept; by default nowhere")
    parser.add_argument("--only", nargs="+", choices=FIGURES, default=list(FIGURES), metavar="NAME", help="which ones")
    arguments = parser.parse_args()
    folder: Path = arguments.output
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        runs: Path = arguments.runs or Path(temporary)
        runs.mkdir(parents=True, exist_ok=True)
        for name in arguments.only:
            draw(FIGURES[name], runs, folder / name)
            print(folder / name)


if __name__ == "__main__":
    main()
