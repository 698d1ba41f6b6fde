"""Drawings: colours, places of labels, and files by matplotlib, which comes with the extra `plot`."""

import base64
import contextlib
import functools
import io
import math
import warnings
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, ParamSpec

from airrace.errors import UsageError
from airrace.files.checkpoint.atomic import replace_file
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.plain_text import plain
from airrace.runtime.standard_streams import STANDARD

# Any: the stubs of matplotlib leave keyword arguments untyped.
Figure = Any
Axes = Any

P = ParamSpec("P")

FORMATS = (".png", ".svg", ".pdf")
DOTS_PER_INCH = 150
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")  # Okabe & Ito: for all eyes
RED, AMBER, BLUE, GREY, BLACK = "#c0392b", "#b8860b", "#34568b", "#777777", "#222222"


def ensure_drawable(path: Path) -> None:
    """Find out now whether a drawing can be made in the format that the name of the file says; stdout takes PNG.

    Raises:
        UsageError: the name says no known format, or matplotlib is not installed.
    """
    if path != STANDARD and path.suffix.lower() not in FORMATS:
        raise UsageError(f"cannot draw into {path}; its name must end in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    if find_spec("matplotlib") is None:
        raise UsageError("drawing needs matplotlib: pip install 'airrace[plot]'")


def without_formulas(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Decorate what makes a drawing, so that a name with dollar signs is no formula.

    A sign that the font lacks is drawn as a box, without a word about it.
    """

    @functools.wraps(draw)
    def figure(*args: P.args, **kwargs: P.kwargs) -> Figure:
        import matplotlib

        library: Any = matplotlib  # Any: its stubs leave paths untyped
        with library.rc_context({"text.parse_math": False}), _boxes_for_unknown_signs():
            return draw(*args, **kwargs)

    return figure


@contextlib.contextmanager
def _boxes_for_unknown_signs() -> Generator[None]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+ .* missing from font", UserWarning)
        yield


def new_figure(
    width: float, height: float, *, layout: Literal["constrained", "compressed"] | None = "constrained"
) -> Figure:
    """Return an empty drawing that no window shows; inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Drawing

    figure: Figure = Drawing(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path) -> None:
    """Write a drawing in the format that the name of the file says, replacing the file as a whole.

    Raises:
        StorageError: the system refused.
    """
    content = io.BytesIO()
    _without_controls(figure)
    with _boxes_for_unknown_signs():
        figure.savefig(content, format=path.suffix.lower().removeprefix(".") or "png", dpi=DOTS_PER_INCH)
    replace_file(path, content.getvalue())


def save_sheets(sheets: Sequence[Figure], path: Path) -> None:
    """Write drawings as the pages of a PDF, or the only one in the format that the name says, replacing the file.

    Raises:
        StorageError: the system refused.
    """
    if path.suffix.lower() != ".pdf":
        (only,) = sheets
        save_figure(only, path)
        return
    from matplotlib.backends import backend_pdf

    library: Any = backend_pdf  # Any: its stubs leave keyword arguments untyped
    content = io.BytesIO()
    with library.PdfPages(content) as pages, _boxes_for_unknown_signs():
        for sheet in sheets:
            _without_controls(sheet)
            pages.savefig(sheet)
    replace_file(path, content.getvalue())


def _without_controls(figure: Figure) -> None:
    """Show control characters in the texts of a drawing as what they are: XML, which SVG is, cannot hold them."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        text.set_text(plain(text.get_text()))


def figure_address(figure: Figure) -> str:
    """Return a drawing as SVG in an address for a page; the same drawing has the same."""
    import matplotlib

    library: Any = matplotlib  # Any: its stubs leave paths untyped
    content = io.BytesIO()
    _without_controls(figure)
    with library.rc_context({"svg.hashsalt": "airrace"}), _boxes_for_unknown_signs():
        figure.savefig(content, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"


LABEL_DIRECTIONS = 12
"""Around a place in which its label may go."""
LABEL_GAPS = (1.0, 2.0, 3.5, 5.5)
"""Distances between a place and its label, as multiples of the gap asked for."""
OVERLAP_COST = 50.0
"""The price of lying on another label, in points of the drawing that a label covers."""
OUTSIDE_COST = 1000.0
"""The price of lying outside the frame; at that of an overlap, of four places in a corner the last label lay half
outside.
"""


@dataclass(frozen=True)
class Box:
    """A rectangle with edges along the axes, in any unit."""

    left: float
    bottom: float
    width: float
    height: float

    def overlap(self, other: "Box") -> float:
        """Return the area in common with another rectangle."""
        across = min(self.left + self.width, other.left + other.width) - max(self.left, other.left)
        up = min(self.bottom + self.height, other.bottom + other.height) - max(self.bottom, other.bottom)
        return max(across, 0.0) * max(up, 0.0)

    def count_inside(self, points: Array) -> int:
        """Return the number of the points, shape (n, 2), that lie inside."""
        across = (points[:, 0] > self.left) & (points[:, 0] < self.left + self.width)
        return int((across & (points[:, 1] > self.bottom) & (points[:, 1] < self.bottom + self.height)).sum())


def place_labels(
    anchors: Sequence[tuple[float, float]], sizes: Sequence[tuple[float, float]], points: Array, frame: Box, gap: float
) -> list[Box]:
    """Return a box for every label, placed one after the other where it costs least.

    Args:
        anchors: the places that the labels name.
        sizes: the width and height of each label.
        points: of what should stay visible, shape (n, 2).
        frame: the rectangle to stay within.
        gap: the least distance from the anchor.
    """
    boxes: list[Box] = []
    for (x, y), (width, height) in zip(anchors, sizes, strict=True):
        choices: list[tuple[float, Box]] = []
        for distance in LABEL_GAPS:
            for number in range(LABEL_DIRECTIONS):
                angle = 2.0 * math.pi * number / LABEL_DIRECTIONS
                across = x + math.cos(angle) * (distance * gap + 0.5 * width)
                up = y + math.sin(angle) * (distance * gap + 0.5 * height)
                box = Box(across - 0.5 * width, up - 0.5 * height, width, height)
                area = width * height
                overlap = sum(box.overlap(other) for other in boxes) / area
                outside = 1.0 - box.overlap(frame) / area
                cost = OVERLAP_COST * overlap + OUTSIDE_COST * outside + box.count_inside(points) + 0.02 * len(choices)
                choices.append((cost, box))
        boxes.append(min(choices, key=lambda choice: choice[0])[1])
    return boxes
