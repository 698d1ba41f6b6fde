"""What is drawn on a terminal: a console that texts cannot command, and on it the live view of a run, a panel."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from rich.console import Console, ConsoleOptions, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from airrace.pages.views.plain_text import plain
from airrace.pages.views.progress_lines import outcome_line, stage_number
from airrace.procedure.result import Iteration, Progress, StageResult
from airrace.procedure.stage import Stage


class PlainConsole(Console):
    """A console whose contents cannot command the terminal; what it draws around them still does."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as the base class does, with plain texts."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=plain(segment.text))


ROWS = ("stage", "doing", "", "iteration", "objective", "infeasibility")


@dataclass(frozen=True)
class _StageUnderWay:
    """The stage under way: which one, its number in the run, since when, and what it is doing."""

    stage: Stage
    number: str
    since: float
    activity: str = ""
    done: int = 0
    total: int = 0
    iteration: Iteration | None = None


class LiveView(Progress):
    """An observer that shows a live panel; finished stages scroll away above it."""

    def __init__(
        self,
        title: str,
        console: Console,
        stages: Sequence[Stage] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = title
        self._console = console
        self._stages = stages
        self._clock = clock
        self._started = clock()
        self._current: _StageUnderWay | None = None
        self._between = ("", 0, 0)  # what is done besides the stages
        self.live = Live(
            console=console,
            get_renderable=self._render,
            refresh_per_second=8,
            transient=True,
            redirect_stdout=False,  # stdout is data
        )

    def stage_started(self, stage: Stage) -> None:
        self._current = _StageUnderWay(stage, stage_number(stage, self._stages), self._clock())
        self._between = ("", 0, 0)

    def activity(self, text: str, done: int, total: int) -> None:
        if self._current is not None:
            self._current = replace(self._current, activity=text, done=done, total=total, iteration=None)
        else:
            self._between = text, done, total

    def iteration(self, iteration: Iteration) -> None:
        if self._current is not None:
            self._current = replace(self._current, iteration=iteration)

    def stage_finished(self, result: StageResult) -> None:
        if not result.search.goes_on:
            self._current = None
        self.live.console.print(Text(outcome_line(result)))

    def remark(self, text: str) -> None:
        self.live.console.print(Text(text))

    def _render(self) -> RenderableType:
        now = self._clock()
        rows = Table.grid(padding=(0, 2), expand=True)
        rows.add_column(style="dim", width=13)
        rows.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
        for name, value in _rows(self._current, self._between, now):
            rows.add_row(name, value)
        rows.add_row("elapsed", _duration(now - self._started))
        # A box of the same size whatever happens in it, so that nothing jumps.
        width = min(76, self._console.width)
        return Panel(rows, title=Text(self._title), title_align="left", width=width, padding=(0, 1))


def _rows(
    current: _StageUnderWay | None, between: tuple[str, int, int], now: float
) -> Iterator[tuple[str, RenderableType]]:
    """Yield always the same rows; without a stage they tell of what is done besides, if anything."""
    if current is None:
        text, done, total = between
        bar = ProgressBar(total=total, completed=done, width=40) if total else Text("")
        shown: dict[str, RenderableType] = {"doing": Text(text), "": bar}
        yield from ((name, shown.get(name, Text(""))) for name in ROWS)
        return
    iteration = current.iteration
    columns = ("-", "-", "-")
    if iteration is not None:
        columns = (str(iteration.number), f"{iteration.objective:.3f} s", f"{iteration.infeasibility:.1e}")
    number = f", {current.number}" if current.number else ""
    done = ProgressBar(total=current.total, completed=current.done, width=40) if current.total else Text("")
    values = (
        Text.assemble((current.stage.value, "bold"), f"{number}, {_duration(now - current.since)}"),
        Text(current.activity or "preparing"),
        done,
        *(Text(text) for text in columns),
    )
    yield from zip(ROWS, values, strict=True)


def _duration(seconds: float) -> str:
    """Return seconds as a text, from a minute on as minutes and seconds."""
    return f"{seconds:.1f} s" if seconds < 60.0 else f"{int(seconds) // 60}:{int(seconds) % 60:02d} min"
