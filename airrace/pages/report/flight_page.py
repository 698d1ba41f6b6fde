"""A report about flights as one file: style, script, contents and tables in a page that can load nothing from anywhere.

The page's own policy says so to the browser: only the script and the styles whose hashes it names run or apply, and
there is no address from which anything could be fetched. Pictures exist only as data within the page.
"""

import base64
import hashlib
import html
import math
import string
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from airrace.flights.results import Flight, laps_of
from airrace.flights.results.clearances import near_misses
from airrace.flights.results.comparison import Comparison, compare_flights, conditions
from airrace.flights.results.cues import cues_of
from airrace.flights.results.flight_facts import Range, leg_facts, sustained_loads
from airrace.flights.results.time_loss import time_loss
from airrace.pages.report.contents import as_json, clock_start, contents_of, unit_of
from airrace.pages.report.film import Language
from airrace.pages.report.languages import state_text, wind_text
from airrace.pages.report.script import FOLDER, LIBRARIES, page_script
from airrace.pages.report.sections import capitalise, note, number, section, table_section
from airrace.pages.views.comparison_tables import (
    difference_text,
    loss_head,
    lost_table,
    part_text,
    recorded_sectors,
    sectors_notes,
    sectors_table,
)
from airrace.pages.views.cue_tables import NOTE, cue_table
from airrace.pages.views.map_model import MapModel, by_loss, by_speed, map_model
from airrace.pages.views.plain_text import escape_html, plain
from airrace.pages.views.plan_svg import MARGIN, pixels_per_metre, plan_svg
from airrace.pages.views.stage_tables import distance_table
from airrace.pages.views.tables import RACE, Cell, Column, Table, Units

if TYPE_CHECKING:
    from airrace.flights.safety.monte_carlo import SafetyResult

STYLES = (LIBRARIES / "uplot" / "uPlot.min.css", FOLDER / "style" / "page.css")
SCENE_ALONE = """/* Nothing but the scene and its transport, in the whole window. */
.mast, .tables, .strips-head, .strips, .plan, footer, .transport .full { display: none !important; }
body, main, .stage { margin: 0; padding: 0; max-width: none; }
.watch { display: grid; grid-template-rows: minmax(0, 1fr) auto; height: 100vh; gap: 0; }
.watch .scene { height: 100%; border: 0; border-radius: 0; }
"""
READINGS = (
    ("Indicated", "V_I", 0, 0),
    ("Height", "height", 0, 0),
    ("Load factor", "n_z", 1, 0),
    ("Bank", "mu", 0, 360),
    ("Roll rate", "p_Kbar", 0, 0),
    ("Climb", "gamma", 0, 0),
)
"""Numbers of the present instant over the scene: title, history, digits, and after how many units it repeats."""


def flight_page(
    flights: Sequence[Flight],
    sections: Sequence[str] = (),
    footer: str = "",
    *,
    claimed: bool = False,
    envelope: "SafetyResult | None" = None,
    style: str = "",
    units: Units = RACE,
    language: Language = Language.EN,
) -> str:
    """Return the page about some flights as HTML.

    Args:
        flights: the first is what the page is about, the others fly beside it as its ghosts.
        sections: HTML of further sections, which stand below the legs; empty ones are left out.
        footer: plain text.
        claimed: whether `sections` hold one called `claim`, to which the badge leads: what is claimed of the first
            flight, and what is not.
        style: CSS that comes after the page's own, such as `SCENE_ALONE`.
        units: of speeds and lengths.
        language: of films and cards that are taken of the page, whose own texts are English.

    Raises:
        UsageError: a flight is of a course with other passings.
    """
    first = flights[0]
    comparisons = [compare_flights(first, flight) for flight in flights[1:]]
    losses = [comparison_section(comparison, units) for comparison in comparisons]
    facts = [
        flights_section(flights),
        legs_section(first, units),
        distances_section(first, units),
        cues_section(first, units),
    ]
    map_ = map_model(first.race)
    loss_sections = [loss_section(flights, comparison, map_, units) for comparison in comparisons]
    sections = [*loss_sections, sectors_section(flights, units), *facts, *losses, *sections]
    track = np.stack([first["x"], first["y"]], axis=1)
    style = "\n".join([*(path.read_text(encoding="utf-8") for path in STYLES), *[style] * bool(style)])
    script = page_script()
    misses = len(near_misses(first))
    near = f", {misses} pylon{'' if misses == 1 else 's'} too near" if misses else ""
    verification = first.source.verification
    outcome = "" if verification is None or verification.verified else f"; {verification.outcome}"
    look = f'class="verdict {_colour(first, misses)}"'
    card = {"subtitle": _subtitle(first, units), "state": f"{first.source.state or 'recorded'}{near}"}
    if language is not Language.EN:
        parts = (first.aircraft.name, first.source.stage, wind_text(first, language, units))
        card = {"subtitle": ", ".join(filter(None, parts)), "state": state_text(first, misses, language)}
    words = escape_html(f"{first.source.verdict or 'recorded'}{outcome}{near}")
    verdict = f"<div {look}>{words}</div>"
    if claimed:
        verdict = f'<a {look} href="#claim" title="What this says, and what it does not">{words}</a>'
    template = string.Template((FOLDER / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        # Attributes `style` are allowed within elements, for drawings carry them; they cannot load anything either.
        policy=f"default-src 'none'; script-src {source_hash(script)}; style-src-elem {source_hash(style)}; "
        "style-src-attr 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'",
        title=html.escape(plain(first.course.name)),
        heading=escape_html(first.course.name),
        subtitle=escape_html(_subtitle(first, units)),
        stamp=escape_html(first.stamp.text),
        race_time=number(first.race_time, 3),
        verdict=verdict,
        readings="".join(
            f'<div><dt>{title}</dt><dd><span data-history="{history}" data-digits="{digits}" data-wraps="{wraps}">'
            f"</span><small>{unit_of(history, units)}</small></dd></div>"
            for title, history, digits, wraps in READINGS
            if history in first
        ),
        plan=plan_svg(map_.with_track(track), by_speed(track, first["V_K"])),
        sections="\n".join(filter(None, sections)),
        footer=escape_html(footer),
        style=style,
        contents=as_json(contents_of(flights, comparisons, map_, envelope, units, language, card)),
        script=script,
    )


def _colour(flight: Flight, misses: int) -> str:
    """Return the colour of the badge: bad for what was refuted or does not hold, never for what is verified."""
    verification = flight.source.verification
    if verification is not None and verification.verified is False:
        return "bad"
    verified = verification is not None and bool(verification.verified)
    if flight.source.doubtful and not verified:
        return "bad"
    if misses:
        return "caution"
    return "unsure" if flight.source.doubtful or not (verified or verification is None) else "good"


def source_hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def _subtitle(flight: Flight, units: Units) -> str:
    """Return a line that says which aircraft flies, at which stage, and in which wind."""
    wind = flight.air.wind
    blowing = "calm air"
    if wind is not None and wind.speed > 0.0:
        blowing = (
            f"wind {wind.speed * units.per_m_s:.0f} {units.speed} from {round(math.degrees(wind.origin)) % 360:03d}°"
        )
    return ", ".join(text for text in (flight.aircraft.name, flight.source.stage, blowing) if text)


def flights_section(flights: Sequence[Flight]) -> str:
    """Return a table of all flights with their race times; empty where there is only one."""
    if len(flights) < 2:
        return ""
    first = flights[0]
    columns = (
        Column("flight"),
        Column("aircraft"),
        Column("race time", "s", ".3f"),
        Column("difference", "s", "+z.3f"),
        Column("state"),
    )
    rows = [
        (
            Cell(flight.label, flight=place),
            flight.aircraft.name,
            flight.race_time,
            "" if flight is first else flight.race_time - first.race_time,
            flight.source.state or "recorded",
        )
        for place, flight in enumerate(flights)
    ]
    remark = "The first flight is the one that the page is about; the others fly beside it on the same clock."
    return table_section(Table("Flights", columns, rows, [remark]))


def legs_section(flight: Flight, units: Units) -> str:
    """Return a table of what a flight does leg by leg, and of what it comes near to."""
    columns = (
        Column("to"),
        Column("at", "s", ".3f"),
        Column("leg", "s", ".3f"),
        Column("indicated", units.speed, ".0f"),
        Column("over ground", units.speed, ".0f"),
        Column("load factor", "g", ".1f"),
        Column("height", units.length, ".0f"),
        Column("roll rate", "°/s, most", ".0f"),
        Column("energy height", f"{units.length}, at the end", ".0f", factor=units.per_m),
        Column("nearest", units.length, "z.1f", factor=units.per_m),
        Column("required", units.length, "z.1f", factor=units.per_m),
        Column("to what"),
    )
    begin = clock_start(flight)
    rows: list[tuple[Cell | str | float | None, ...]] = []
    for facts in leg_facts(flight):
        leg, nearest = facts.leg, facts.clearances[0] if facts.clearances else None
        rows.append(
            (
                Cell(leg.name, time=leg.before.time - begin if leg.before.found else None),
                leg.after.time - begin,
                leg.time,
                _range(facts.V_I, units.per_m_s, 0),
                _range(facts.V_K, units.per_m_s, 0),
                _range(facts.n_z, 1.0, 1),
                _range(facts.height, units.per_m, 0),
                math.degrees(facts.roll_rate),
                facts.energy_out,
                *((None, None, "") if nearest is None else (nearest.distance, nearest.required, nearest.text)),
            )
        )
    notes: list[str] = []
    if len(laps := laps_of(flight)) > 1:
        notes.append(f"Laps: {', '.join(f'{lap.number} in {number(lap.time, 3)} s' for lap in laps)}.")
    misses = [
        f"{near_miss.clearance.name} ({number(near_miss.clearance.distance * units.per_m, 2)} {units.length}, "
        f"{near_miss.where})"
        for near_miss in near_misses(flight)
    ]
    if misses:
        notes.append(f"The wing passes pylons closer than their own passing allows: {'; '.join(misses)}.")
    notes += [f"Warning: {load.text}." for load in sustained_loads(flight)]
    return table_section(Table("Legs", columns, rows, notes, by_leg=True))


def distances_section(flight: Flight, units: Units) -> str:
    """Return a table of the least distance from every thing on the course; empty where nothing is known."""
    remark = "Pylons and obstacles are measured from the wing, all else from the aircraft's centre."
    table = distance_table(flight, "Least distances", begin=clock_start(flight), notes=[remark], units=units)
    return table_section(table) if table.rows else ""


def cues_section(flight: Flight, units: Units) -> str:
    """Return a table of what the pilot does leg by leg; empty where the flight does not know it."""
    cues = cues_of(flight)
    if not cues:
        return ""
    return table_section(cue_table(cues, "What the pilot does", begin=clock_start(flight), notes=[NOTE], units=units))


def _range(values: Range, factor: float, digits: int) -> str:
    """Return a range as a text, from the least to the greatest value; a dash where nothing is known."""
    least, greatest = number(factor * values.least, digits), number(factor * values.greatest, digits)
    return least if least == greatest else f"{least} … {greatest}"


def loss_section(flights: Sequence[Flight], comparison: Comparison, map_: MapModel, units: Units) -> str:
    """Return in words what costs the slower of two flights most, and its track in the colours of the time lost."""
    loss = time_loss(comparison)
    reference, other = loss.comparison.reference, loss.comparison.flight
    begin = clock_start(flights[0])
    items: list[str] = []
    for item in loss.costliest:
        leg = item.legs[0].reference if reference is flights[0] else item.legs[0].flight
        time, words = leg.before.time - begin, escape_html(loss_head(item))
        head = f'<button data-time="{time:.6f}" title="To this leg">{words}</button>'
        parts = [part_text(part, units) for part in item.parts if part.hundredths]
        clauses = [*parts, *(difference_text(fact, units) for fact in item.leaving)]
        items.append(f"<li>{head}<ul>{''.join(f'<li>{escape_html(clause)}</li>' for clause in clauses)}</ul></li>")
    heading = f"<p>{escape_html(capitalise(loss.title))}:</p>" if items else ""
    words = f'<div>{heading}<ol class="losses">{"".join(items)}</ol></div>'
    body = f'<div class="lost">{words}<div>{_loss_map(flights, loss.comparison, map_, units)}</div></div>'
    return section(f"Where the time of {other.label} went", body)


def _loss_map(flights: Sequence[Flight], comparison: Comparison, map_: MapModel, units: Units) -> str:
    """Return the map of a comparison, which the script of the page links with the clock, and what its colours mean."""
    coloured = by_loss(comparison, units)
    both = comparison.flight, comparison.reference
    lines = [np.stack([flight["x"], flight["y"]], axis=1) for flight in both]
    map_ = map_.with_track(lines[0]).with_track(lines[1], dashed=True)
    place = {"scale": pixels_per_metre(map_), "margin": MARGIN, "north": map_.north, "west": map_.west}
    numbers = " ".join(str(flights.index(flight)) for flight in both)
    data = " ".join(f'data-{name}="{value:.6f}"' for name, value in place.items())
    figure = f'<figure class="map" {data} data-shown="{numbers}">{plan_svg(map_, coloured, scale=False)}</figure>'
    least, greatest = (escape_html(end) for end in coloured.ends)
    ramp = "".join(f'<i style="background: {colour}"></i>' for colour in coloured.colours)
    key = f'<div class="ramp-key"><span>{least}</span>{ramp}<span>{greatest}</span></div>'
    words = f"{both[0].label} in the colours of the time lost at a place, {both[1].label} dashed; a click leads there."
    return figure + key + note(words)


def sectors_section(flights: Sequence[Flight], units: Units) -> str:
    """Return a table of the recorded flights sector by sector; empty for fewer than two."""
    sectors = recorded_sectors(flights)
    if sectors is None:
        return ""
    title = f"{len(sectors.flights)} recorded flights, sector by sector"
    return table_section(sectors_table(sectors, title, sectors_notes(sectors, units)))


def comparison_section(comparison: Comparison, units: Units) -> str:
    """Return a table of the legs on which another flight loses its time, and of what it flies otherwise there."""
    reference, other = comparison.reference, comparison.flight
    notes = [
        f"Positive where it is slower than {reference.label}; the legs on which it loses most come first.",
        *(
            f"{capitalise(what)}: {value} against {reference_value}."
            for what, reference_value, value in conditions(reference, other)
        ),
    ]
    title = f"Where {other.label} loses and wins"
    return table_section(lost_table(comparison.by_loss, title, begin=clock_start(reference), notes=notes, units=units))
