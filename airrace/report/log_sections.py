"""The sections of a report about a flown log: rules that would be broken, and how it was recorded."""

import math
from collections.abc import Sequence

from airrace.logs.breach import Breach
from airrace.report.html_tables import Cell, Head, Row, facts, note, number, section, table

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


def breaches_section(breaches: Sequence[Breach], penalty: float) -> str:
    """Return a table of all rules that a flight would break."""
    if not breaches:
        return section("Rules", note("Every passing keeps the rules of the course."))
    rows = [
        Row((
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
