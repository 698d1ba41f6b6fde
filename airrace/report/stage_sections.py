"""The sections of a report about the stage that found a flight: certificate, ways tried, prices, inputs."""

import math
from collections.abc import Mapping, Sequence

from airrace.inputs import Inputs
from airrace.optimal_control.certificate import Certificate, Item
from airrace.procedure.result import StageResult
from airrace.quantities import KNOT
from airrace.report.html_tables import Cell, Head, Row, facts, folded, note, number, section, table, with_minus
from airrace.sensitivity.price import Activity, Price

PRICES_SHOWN = 40
"""The largest number of prices in the table, the dearest first."""
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
        Row((
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
    """Return the ways round that a stage tried; empty where it tried none."""
    explored = result.search
    if not explored.ways:
        return ""
    rows = [
        Row((way.text, number(way.race_time, 3), number(way.difference, 3, signed=True), way.priced))
        for way in explored.ways
    ]
    told = (
        f"Race times and differences are those of the {result.stage.value} on a rough mesh; the best way was then "
        "optimised in full."
    )
    return section("Ways that were tried", table(WAYS, rows) + note(" ".join((told, *explored.loops))))


def prices_section(prices: Mapping[str, Price] | None) -> str:
    """Return the dearest numbers of the inputs; empty where prices are not known."""
    if prices is None:
        return ""
    dear = [price for price in prices.values() if price.activity is not Activity.FREE][:PRICES_SHOWN]
    rows = [
        Row((
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
    return given_section(inputs, [("stage", solved)], versions)


def given_section(inputs: Inputs, further: Sequence[tuple[str, str]], versions: Mapping[str, str]) -> str:
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
