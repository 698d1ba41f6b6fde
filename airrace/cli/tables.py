"""Tables for people. Units of the cockpit appear here and in no lower layer; each column names its own."""

import codecs
import io
import math
import sys
from collections.abc import Sequence

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from airrace.cli.ways_table import ways_table
from airrace.inputs.units import KNOT
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import Outcome, StageResult, State
from airrace.views.plain_console import PlainConsole

# Columns that are enough for every table where no terminal sets a limit.
UNLIMITED_WIDTH = 200
FULL_WIDTH = 10_000
"""The columns that limit no table when it is measured."""
PAGE = 80
"""The columns of a page: of tables that are wrapped to it where nobody's terminal sets a limit."""

DOES_NOT_STAND = "NOT certified: its items may hold, but the stage does not stand"
ONE_MESH = "checked on one mesh; no second mesh has confirmed the race time"

_DEGREES = {"rad": "deg", "rad/s": "deg/s"}


def rendered(content: RenderableType, *, columns: int = UNLIMITED_WIDTH) -> str:
    """Return a table or a picture as text for stdout.

    Without a terminal the text is plain, whatever the environment says of colours; where stdout takes no Unicode, rules
    are of ASCII.

    A terminal too narrow for a table wraps its lines: a number cut short would be a wrong one.

    Args:
        content: what is shown.
        columns: to use where there is no terminal; more where the content cannot be narrower.
    """
    terminal = sys.stdout.isatty()
    written = io.BytesIO()
    text = io.TextIOWrapper(written, encoding=_encoding(), errors="backslashreplace", newline="\n")
    console = PlainConsole(
        file=text,
        force_terminal=terminal,
        no_color=None if terminal else True,
        width=None if terminal else columns,
        highlight=False,
    )
    narrowest = console.measure(content, options=console.options.update(max_width=UNLIMITED_WIDTH)).minimum
    console.width = max(console.width, narrowest)
    console.print(content)
    text.flush()
    return "\n".join(line.rstrip() for line in written.getvalue().decode(_encoding()).splitlines())


def takes_unicode() -> bool:
    """Return whether stdout can show more than ASCII."""
    return _encoding().startswith("utf")


def full_columns(table: Table) -> int:
    """Return the columns that a table takes where nothing limits it."""
    return PlainConsole(file=io.StringIO(), width=FULL_WIDTH).measure(table).maximum


def terminal_columns() -> int | None:
    """Return the columns of the terminal behind stdout; None if there is none."""
    return Console().width if sys.stdout.isatty() else None


def result_tables(result: StageResult, *, certificate: bool = True) -> list[Table]:
    """Return what a finished stage shows: its gate splits and its certificate; without a flight nothing.

    Args:
        result: the stage.
        certificate: whether the items of its certificate are listed.
    """
    tables = [splits_table(result)] if result.splits and result.is_flight else []
    tables += [ways_table(result.search)] if result.search.ways else []
    if certificate and result.certificate is not None:
        stands = result.outcome is Outcome.SOLVED or not result.certificate.holds
        tables.append(certificate_table(result.certificate, "" if stands else DOES_NOT_STAND))
    return tables


def splits_table(result: StageResult) -> Table:
    """Return a table of the passings; `leg` is the time since the passing before."""
    table = _table(f"{result.stage.value}: race time {result.trajectory.race_time:.3f} s", "gate")
    _numbers(table, "time\ns", "leg\ns", "speed\nm/s", "speed\nkt", "height\nm", "load\ng", "bank\ndeg", "climb\ndeg")
    before = result.splits[0].time if result.splits else 0.0
    for split in result.splits:
        table.add_row(
            Text(split.name),
            f"{split.time:.3f}",
            f"{split.time - before:.3f}",
            f"{split.V_K:.1f}",
            f"{split.V_K / KNOT:.1f}",
            f"{split.height:.1f}",
            f"{split.n_z:z.2f}",
            _degrees(split.bank),
            _degrees(split.climb),
        )
        before = split.time
    return table


def certificate_line(result: StageResult) -> str:
    """Return the verdict with the item that comes nearest to its limit, or with those that fail."""
    certificate = result.certificate
    if certificate is None:
        return ""
    items, failed = certificate.items, certificate.failed
    if certificate.holds and not result.holds:
        return f"certificate: {DOES_NOT_STAND}"
    if failed or not items:
        told = ", ".join(f"{item.name} {item.value:.3g} > {item.limit:.3g} {item.unit}".rstrip() for item in failed)
        return f"certificate: NOT certified ({certificate.solver_status}): {told or 'nothing was measured'}"
    limited = [item for item in items if item.limit > 0.0]
    nearest = max(limited, key=lambda item: item.value / item.limit, default=None)
    tightest = "" if nearest is None else f"; nearest to its limit: {nearest.name}, {nearest.value / nearest.limit:.0%}"
    verdict = "certified" if certificate.certified else ONE_MESH
    return f"certificate: {verdict} ({certificate.solver_status}), all {len(items)} items hold{tightest}"


def certificate_table(certificate: Certificate, verdict: str = "") -> Table:
    """Return a table of all items with their limits, and where the worst value lies if it is not zero.

    Args:
        certificate: with the items.
        verdict: what is said of it; empty for what the items say.
    """
    measured = "certified" if certificate.certified else ONE_MESH if certificate.holds else "NOT certified"
    verdict = verdict or measured
    table = _table(f"certificate: {verdict} ({certificate.solver_status})", "item")
    _numbers(table, "value", "limit")
    for column in ("unit", "holds", "worst at"):
        table.add_column(column)
    for item in certificate.items:
        value, limit, unit = _for_people(item)
        holds = Text("yes") if item.holds else Text("NO", style="bold red")
        where = Text("" if value == 0.0 else item.where)
        table.add_row(Text(item.name), f"{value:.3g}", f"{limit:.3g}", unit, holds, where)
    return table


def stages_table(results: Sequence[StageResult]) -> Table:
    """Return a table of the finished stages.

    The column `cost` is what a fidelity adds to the time of the optimum before it that holds.
    """
    table = _table("stages", "stage")
    table.add_column("status")  # of two words, which a narrow terminal puts below each other
    _numbers(table, "time\ns", "cost\ns", "regul.\ns", "track.\nm", "iter.", "wall\ns")
    before: float | None = None
    for result in results:
        race_time, provenance = result.trajectory.race_time, result.provenance
        optimum = result.is_flight and result.state is not State.GUESS
        table.add_row(
            result.stage.value,
            _status(result),
            f"{race_time:.3f}" if result.is_flight else "-",
            f"{race_time - before:+.3f}" if optimum and before is not None else "-",
            f"{provenance.regularisation:.3f}" if optimum else "-",
            f"{provenance.tracking_error:.2f}" if provenance.source else "-",
            str(result.iterations),
            f"{result.timings.wall:.1f}",
        )
        before = race_time if result.holds else before
    if any(result.state is State.SOLVED for result in results):
        table.caption = Text(f"solved: {ONE_MESH}")
        table.caption_justify = "left"
    return table


def _status(result: StageResult) -> Text:
    """Return how a stage ended, in the words that matter most."""
    if result.state is State.NOT_CERTIFIED:
        return Text("NOT certified", style="bold red")
    sound = result.state in (State.CERTIFIED, State.SOLVED, State.GUESS)
    return Text(result.state.value, style="" if sound else "bold red")


def plain_table(title: str, names: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of ready texts: columns of names on the left, of numbers on the right."""
    table = _table(title, *names)
    _numbers(table, *numbers)
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table


def _encoding() -> str:
    """Return the encoding of stdout, as Python spells it."""
    return codecs.lookup(sys.stdout.encoding or "utf-8").name


def _table(title: str, *names: str) -> Table:
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True, show_edge=False
    )
    for name in names:
        table.add_column(name, no_wrap=True)
    return table


def _numbers(table: Table, *names: str) -> None:
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):z.1f}"


def _for_people(item: Item) -> tuple[float, float, str]:
    """Return value, limit and unit of an item, angles in degrees."""
    if item.unit in _DEGREES:
        return math.degrees(item.value), math.degrees(item.limit), _DEGREES[item.unit]
    return item.value, item.limit, item.unit
