"""Sections of a report as HTML: tables of stages and of flight logs."""

import math
from collections.abc import Iterable, Mapping, Sequence

from airrace.files.inputs import Inputs
from airrace.flights.logs.violations import CERTAIN_DEVIATIONS, Violation, select_violations
from airrace.flights.results import Stamp, Verification
from airrace.flights.sensitivity import Sensitivity
from airrace.optimal_control.certificate import Certificate
from airrace.optimal_control.quantities import KNOT
from airrace.pages.report.sensitivity_tables import sensitivities_table
from airrace.pages.views.log_tables import penalties_text, violations_table
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.stage_tables import LIMITS_OF_CLAIM, bound_text, certificate_table, search_table
from airrace.pages.views.tables import Column, Table
from airrace.procedure.result import StageResult


def number(value: float, digits: int) -> str:
    """Return a number as people read it in a sentence; a dash where there is none."""
    return Column(form=f"z.{digits}f").html(value)


def capitalise(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def section(title: str, body: str) -> str:
    """Return a part of the page with a heading; `body` is HTML."""
    return f'<section class="panel"><h2>{escape_html(title)}</h2>{body}</section>'


def table_section(table: Table) -> str:
    """Return a part of the page with a table, whose rows are lists on narrow screens, and its notes."""
    return section(table.title, table.html(inline=False) + note(" ".join(table.notes)))


def note(text: str) -> str:
    """Return a sentence below a table."""
    return f'<p class="note">{escape_html(text)}</p>' if text else ""


def _facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Return a list of names and what they stand for."""
    entries = "".join(f"<dt>{escape_html(name)}</dt><dd>{escape_html(text)}</dd>" for name, text in pairs)
    return f'<dl class="facts">{entries}</dl>'


def claim_section(claim: str, verification: Verification, stamp: Stamp) -> str:
    """Return what is claimed of a flight, whether that was verified, and what it does not say; its badge leads there.

    Args:
        claim: empty where nothing is claimed.
        verification: the outcome of measuring the stage again.
        stamp: what the flight is.
    """
    texts = [claim or "nothing is claimed of this flight", verification.words, stamp.text]
    body = "".join(f"<p>{escape_html(capitalise(text))}.</p>" for text in texts)
    if claim:
        is_reached = stamp.reserve is not None and stamp.reserve.reached and not stamp.reserve.source
        limits = LIMITS_OF_CLAIM[:-1] if is_reached else LIMITS_OF_CLAIM  # the last one says that there is no reserve
        body += f"<ul>{''.join(f'<li>{escape_html(limit)}</li>' for limit in limits)}</ul>"
    return f'<section class="panel" id="claim"><h2>What is claimed, and what is not</h2>{body}</section>'


def certificate_section(certificate: Certificate | None) -> str:
    """Return a table of every item of a certificate with its limit; empty without a certificate."""
    if certificate is None:
        return ""
    table = certificate_table(certificate, "Certificate", [f"The solver says: {certificate.solver_status}."])
    return table_section(table)


def search_section(result: StageResult) -> str:
    """Return the routes that a stage tried; empty where it tried none."""
    search = result.search
    if not search.routes:
        return ""
    mesh = "Race times are those of the point mass on a rough mesh; the first route was then optimised in full."
    if search.refined:
        mesh = f"Race times are those of optima of the {result.stage.value}."
    notes = [mesh, *search.loops]
    if search.bound is not None:
        notes.append(f"{capitalise(bound_text(search.bound))}.")
    return table_section(search_table(search, "Routes that were tried", notes=notes))


def sensitivities_section(sensitivities: Mapping[str, Sensitivity] | None) -> str:
    """Return the sensitivities to the numbers of the inputs, the largest first; empty where they are not known."""
    if sensitivities is None:
        return ""
    return table_section(sensitivities_table(list(sensitivities.values()), "Sensitivities", 40))


def inputs_section(inputs: Inputs, further: Sequence[tuple[str, str]], versions: Mapping[str, str]) -> str:
    """Return what was asked for: course, aircraft, air, values set by hand, `further` facts, and the files' texts."""
    race, wind = inputs.race, inputs.race.air.wind
    blowing = "calm"
    if wind is not None and wind.speed != 0.0:
        blowing = f"{wind.speed / KNOT:.0f} kt from {math.degrees(wind.origin) % 360.0:.0f}°"
    pairs = [
        ("course", f"{race.course.name} ({len(race.course.passages) - 1} legs)"),
        ("aircraft", race.aircraft.name),
        ("wind", blowing),
        ("set by hand", ", ".join(inputs.overrides) or "nothing"),
        *further,
        ("made by", ", ".join(f"{name} {version}" for name, version in versions.items())),
    ]
    documents = [("Course", inputs.track), ("Aircraft", inputs.aircraft), ("Settings", inputs.settings_file)]
    texts = [
        f"<details><summary>{name} file</summary><pre>{escape_html(document.text)}</pre></details>"
        for name, document in documents
        if document is not None
    ]
    return section("Inputs", _facts(pairs) + "".join(texts))


def violations_section(violations: Sequence[Violation], assumption: str) -> str:
    """Return a table of all rules that a flight would break, and the accuracy that is assumed, in words."""
    if not violations:
        return section("Rules", note("Every passing keeps the rules of the course."))
    notes = (
        f"Penalties of what is certain: {penalties_text(violations)}.",
        f"A violation smaller than {CERTAIN_DEVIATIONS:g} standard deviations of its measurement (+-) is not certain.",
        f"The deviations are by {assumption}.",
    )
    listed, rest = select_violations(violations)
    return table_section(violations_table(listed, "Rules", (*notes, *[f"{rest}."] * bool(rest))))


def recording_section(pairs: Sequence[tuple[str, str]], remarks: Sequence[str]) -> str:
    """Return where a flight was recorded, and what is to be known of the recording."""
    return section("Recording", _facts(pairs) + "".join(note(f"{capitalise(remark)}.") for remark in remarks))
