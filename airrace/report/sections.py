"""Sections of a report as HTML: tables of stages and of flown logs."""

import math
from collections.abc import Iterable, Mapping, Sequence

from airrace.inputs import Inputs
from airrace.logs.violations import Violation
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import StageResult
from airrace.quantities import KNOT
from airrace.records import record
from airrace.sensitivity.sensitivity import Activity, Price
from airrace.views.plain_text import escaped

DASH = "\N{EN DASH}"
"""Stands where nothing is known."""


@record
class Head:
    """The head of a column.

    Attributes:
        title: what stands in it.
        unit: its unit; empty without one.
        text: whether its cells are words, which are set to the left, rather than numbers.
    """

    title: str
    unit: str = ""
    text: bool = False


@record
class Cell:
    """A cell that is more than its text.

    Attributes:
        text: what stands in it.
        time: s, to which a click on it leads; None for nowhere.
        flight: the number of the flight that a box in it shows and hides; None without a box.
        bad: whether it tells of something that should not be.
    """

    text: str
    time: float | None = None
    flight: int | None = None
    bad: bool = False


@record
class TableRow:
    """Cells of a row; `passing` is the number of the passing that begins what it tells of, None where there is none."""

    cells: Sequence[Cell | str]
    passing: int | None = None


def number(value: float, digits: int, *, signed: bool = False) -> str:
    """Return a number as people read it; a dash where there is none."""
    if not math.isfinite(value):
        return DASH
    return with_minus(f"{value:{'+' if signed else ''}z.{digits}f}")


def with_minus(text: str) -> str:
    """Return a number's text with a minus sign instead of a hyphen."""
    return text.replace("-", "\N{MINUS SIGN}")


def table(heads: Sequence[Head], rows: Iterable[TableRow], caption: str = "") -> str:
    """Return a table that scrolls within its place where it is too wide."""
    head = "".join(f'<th scope="col"{_class(one)}>{escaped(one.title)}{_unit(one.unit)}</th>' for one in heads)
    body = "".join(_row(row, heads) for row in rows)
    told = f"<caption>{escaped(caption)}</caption>" if caption else ""
    return f'<div class="scroll"><table>{told}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def section(title: str, body: str, *, half: bool = False) -> str:
    """Return a part of the page with a heading; `body` is HTML."""
    width = " half" if half else ""
    return f'<section class="panel{width}"><h2>{escaped(title)}</h2>{body}</section>'


def note(text: str) -> str:
    """Return a sentence below a table."""
    return f'<p class="note">{escaped(text)}</p>' if text else ""


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names and what they stand for."""
    entries = "".join(f"<dt>{escaped(name)}</dt><dd>{escaped(text)}</dd>" for name, text in pairs)
    return f'<dl class="facts">{entries}</dl>'


def folded(title: str, text: str) -> str:
    """Return a longer text that is unfolded by a click."""
    return f"<details><summary>{escaped(title)}</summary><pre>{escaped(text)}</pre></details>"


def _row(row: TableRow, heads: Sequence[Head]) -> str:
    passing = "" if row.passing is None else f' data-passing="{row.passing}"'
    cells = "".join(_cell(cell, head) for cell, head in zip(row.cells, heads, strict=True))
    return f"<tr{passing}>{cells}</tr>"


def _cell(cell: Cell | str, head: Head) -> str:
    one = cell if isinstance(cell, Cell) else Cell(cell)
    text = escaped(one.text)
    if one.time is not None:
        text = f'<button data-time="{one.time:.6f}" title="To this instant">{text}</button>'
    if one.flight is not None:
        text = f'<label><input type="checkbox" data-flight="{one.flight}" checked> {text}</label>'
    return f"<td{_class(head, bad=one.bad)}>{text}</td>"


def _class(head: Head, *, bad: bool = False) -> str:
    names = [name for name, holds in (("text", head.text), ("no", bad)) if holds]
    return f' class="{" ".join(names)}"' if names else ""


def _unit(unit: str) -> str:
    return f"<small>{escaped(unit)}</small>" if unit else ""


PRICES_SHOWN = 40
"""The largest number of prices in the table, the largest first."""
CERTIFICATE = (
    Head("item", text=True),
    Head("value"),
    Head("limit"),
    Head("unit", text=True),
    Head("holds", text=True),
    Head("worst at", text=True),
)
WAYS = (Head("route", text=True), Head("race time", "s"), Head("difference", "s"), Head("priced", text=True))
PRICES = (
    Head("number", text=True),
    Head("value"),
    Head("unit", text=True),
    Head("price", "s per unit"),
    Head("step"),
    Head("step up", "ms"),
)


def certificate_section(certificate: Certificate | None) -> str:
    """Return a table of every item of a certificate with its limit; empty without a certificate."""
    if certificate is None:
        return ""
    rows = [
        TableRow((
            item.name,
            *_measured(item),
            Cell("yes" if item.holds else "no", bad=not item.holds),
            item.where,
        ))
        for item in certificate.items
    ]  # fmt: skip
    return section("Certificate", table(CERTIFICATE, rows) + note(f"The solver says: {certificate.solver_status}."))


def _measured(item: Item) -> tuple[str, str, str]:
    """Return value, limit and unit of an item; angles in degrees."""
    turned = item.unit.startswith("rad")
    factor, unit = (math.degrees(1.0), item.unit.replace("rad", "°", 1)) if turned else (1.0, item.unit)
    return f"{item.value * factor:.3g}", f"{item.limit * factor:.3g}", unit


def ways_section(result: StageResult) -> str:
    """Return the routes that a stage tried; empty where it tried none."""
    explored = result.search
    if not explored.ways:
        return ""
    rows = [
        TableRow((way.text, number(way.race_time, 3), number(way.difference, 3, signed=True), way.priced))
        for way in explored.ways
    ]
    told = (
        f"Race times and differences are those of the {result.stage.value} on a rough mesh; the best way was then "
        "optimised in full."
    )
    return section("Routes that were tried", table(WAYS, rows) + note(" ".join((told, *explored.loops))))


def prices_section(prices: Mapping[str, Price] | None) -> str:
    """Return the dearest numbers of the inputs; empty where prices are not known."""
    if prices is None:
        return ""
    dear = [price for price in prices.values() if price.activity is not Activity.FREE][:PRICES_SHOWN]
    rows = [
        TableRow((
            price.key,
            f"{price.value:.6g}",
            price.unit,
            with_minus(f"{price.price:+.3g}"),
            f"{price.usual_step:.3g}",
            number(1e3 * price.cost_up, 1, signed=True),
        ))
        for price in dear
    ]  # fmt: skip
    told = f"The {len(dear)} dearest of {len(prices)} numbers: what a change of each costs, by the multipliers."
    return section("Prices", table(PRICES, rows) + note(told))


def inputs_section(inputs: Inputs, result: StageResult, versions: Mapping[str, str]) -> str:
    """Return what was asked for: course, aircraft, air, values set by hand, and the files' own texts."""
    solved = f"{result.stage.value}, {result.iterations} iterations, {result.timings.wall:.1f} s of wall time"
    return data_section(inputs, [("stage", solved)], versions)


def data_section(inputs: Inputs, further: Sequence[tuple[str, str]], versions: Mapping[str, str]) -> str:
    """Return what was asked for, with further facts between the values set by hand and what made it all."""
    race = inputs.race
    pairs = [
        ("course", f"{race.course.name} ({len(race.course.passages) - 1} legs)"),
        ("aircraft", race.aircraft.name),
        ("wind", _wind(inputs)),
        ("set by hand", ", ".join(inputs.overrides) or "nothing"),
        *further,
        ("made by", ", ".join(f"{name} {version}" for name, version in versions.items())),
    ]
    documents = [("Course", inputs.track), ("Aircraft", inputs.aircraft), ("Settings", inputs.settings_file)]
    texts = [folded(f"{name} file", one.text) for name, one in documents if one is not None]
    return section("Inputs", facts(pairs) + "".join(texts))


def _wind(inputs: Inputs) -> str:
    air = inputs.race.air
    if air.wind is None or air.wind.speed == 0.0:
        return "calm"
    return f"{air.wind.speed / KNOT:.0f} kt from {math.degrees(air.wind.origin) % 360.0:.0f}°"


BREACHES = (
    Head("at", text=True),
    Head("rule", text=True),
    Head("time", "s"),
    Head("flown"),
    Head("allowed"),
    Head("known to"),
    Head("unit", text=True),
    Head("penalty", text=True),
    Head("certain", text=True),
)


def breaches_section(breaches: Sequence[Violation], penalty: float) -> str:
    """Return a table of all rules that a flight would break."""
    if not breaches:
        return section("Rules", note("Every passing keeps the rules of the course."))
    rows = [
        TableRow((
            one.passing or "flight",
            one.rule,
            Cell(number(one.time, 2), time=one.time if math.isfinite(one.time) else None),
            number(one.value, 1),
            number(one.limit, 1),
            number(one.deviation, 1),
            one.unit,
            penalty_text(one.penalty),
            Cell("yes" if one.certain else "no", bad=one.certain),
        ))
        for one in breaches
    ]  # fmt: skip
    total = f"Penalties of what is certain: {penalty_text(penalty)}."
    told = "A breach smaller than three standard deviations of its measurement is not certain."
    return section("Rules", table(BREACHES, rows) + note(f"{total} {told}"))


def recording_section(pairs: Sequence[tuple[str, str]], remarks: Sequence[str]) -> str:
    """Return where a flight was recorded, and what is to be known of the recording."""
    return section("Recording", facts(pairs) + "".join(note(f"{one[:1].upper()}{one[1:]}.") for one in remarks))


def penalty_text(penalty: float) -> str:
    """Return a penalty in words."""
    if math.isnan(penalty):
        return "not known"
    return "ends the race" if math.isinf(penalty) else f"{penalty:g} s"
