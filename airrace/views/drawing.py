"""Drawings in files. Needs matplotlib, which comes with the extra `plot`."""

import base64
import contextlib
import functools
import io
import warnings
from collections.abc import Callable, Generator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, ParamSpec

from airrace.checkpoint.atomic import replace_file
from airrace.errors import UsageError
from airrace.standard_streams import STANDARD

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
    with _boxes_for_unknown_signs():
        figure.savefig(content, format=path.suffix.lower().removeprefix(".") or "png", dpi=DOTS_PER_INCH)
    replace_file(path, content.getvalue())


def figure_address(figure: Figure) -> str:
    """Return a drawing as SVG in an address for a page; the same drawing has the same."""
    import matplotlib

    library: Any = matplotlib  # Any: its stubs leave paths untyped
    content = io.BytesIO()
    with library.rc_context({"svg.hashsalt": "airrace"}), _boxes_for_unknown_signs():
        figure.savefig(content, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"
