"""Draw the comparisons of the documents: what `airrace compare` says of pairs of flights. Needs matplotlib (`plot`).

    python scripts/comparison_figures.py [--output docs/figures] [--runs FOLDER] [--only compare_wind.png ...]

Every flight is a run of `airrace optimize` from the plan, with exploring. Checkpoints are kept in the folder of
`--runs`, and those that lie there already are not flown again. The tables of the comparisons are printed.
"""

import io
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from figures import COMMAND, draw_figures
from PIL import Image

from airrace.results import Flight
from airrace.results.comparison import compare_flights
from airrace.runs.flight_sources import opened_flight
from airrace.views.comparison_figure import comparison_figure

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

    def file(self, runs: Path) -> Path:
        """The checkpoint."""
        return runs / f"{self.run}.h5"

    def name(self, runs: Path) -> str:
        """The name by which the commands take the flight."""
        return f"{self.file(runs)}:{self.stage}"


def wind(degrees: int) -> tuple[str, ...]:
    """The options of 15 kt from a direction."""
    return "--set", f"environment.wind.from_deg={degrees}", "--set", "environment.wind.speed_kt=15"


NO_LINE = ("--set", "course.lap.4.safety_lines=null", "--set", "safety_lines=null")
"""The options that take the safety line of Abu Dhabi away, behind which the flat turn to gate 5 leads."""
ROVINJ, ABU_DHABI = "rovinj_2014", "abu_dhabi_2016"
FIGURES: dict[str, tuple[Flown, Flown]] = {
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
"""The two flights of every figure; the second is held against the first."""


def flown(one: Flown, runs: Path) -> Flight:
    """The flight under its label; what is missing is flown.

    Raises:
        RuntimeError: the run ends with a stage that is not certified.
    """
    run = one.file(runs)
    if not run.exists():
        options = (*one.options, "--guess", "plan", "--until", one.stage, "--quiet", "--output", str(run))
        ended = subprocess.run([*COMMAND, "optimize", one.track, *options], check=False)
        if ended.returncode != 0:
            raise RuntimeError(f"{one.label}: no certified flight")
    return opened_flight(one.name(runs)).labelled(one.label)


def draw(pair: Sequence[Flown], path: Path, runs: Path) -> None:
    """Draw a comparison into a file with a small palette, and print its table."""
    last, first = (flown(one, runs) for one in reversed(pair))  # the second of a run has the higher stage
    subprocess.run([*COMMAND, "compare", *(one.name(runs) for one in pair)], check=True)
    content = io.BytesIO()
    comparison_figure([compare_flights(first, last)]).savefig(content, format="png", dpi=DOTS_PER_INCH)
    Image.open(content).convert("RGB").quantize(SHADES, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    draw_figures(
        "Draw the comparisons of the documents.", {name: partial(draw, pair) for name, pair in FIGURES.items()}
    )
