"""The tables of a flight held against another: laps and legs, those first on which most is lost."""

import math
from collections.abc import Iterator

from airrace.cli.tables import PAGE, render
from airrace.results.comparison import TIE, Comparison, conditions
from airrace.views.tables import Column, Table

TIE_MS = round(1000.0 * TIE)
_LAPS = (
    Column("lap", form="d"),
    Column("reference", "s", ".3f"),
    Column("flight", "s", ".3f"),
    Column("lost", "s", "+.3f"),
)
_LEGS = (
    Column("leg to"),
    Column("time", "s", ".3f"),
    Column("lost", "s", "+.3f"),
    Column("by way", "s", "+.3f"),
    Column("by speed", "s", "+.3f"),
    Column("what differs", wraps=True),
)


def comparison_texts(comparison: Comparison, *, every: bool) -> Iterator[str]:
    """Yield the verdict and the conditions, then the legs with those first on which most is lost.

    Args:
        comparison: of a flight with the reference.
        every: whether legs that are ties are listed, too.
    """
    reference, other = comparison.reference, comparison.other
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    verdict = f"{abs(comparison.difference):.3f} s {'slower' if comparison.difference > 0.0 else 'faster'} ({times})"
    if math.isnan(comparison.difference):
        verdict = "one of them does not finish"
    elif comparison.tie:
        verdict = f"a tie within {TIE_MS} ms ({times})"
    lines = [f"{other.label} against {reference.label}: {verdict}"]
    lines += [f"  {what}: {second} against {first}" for what, first, second in conditions(reference, other)]
    lines += [
        f"  {flight.label} is {flight.source.verdict}"
        for flight in (other, reference)
        if flight.source.certified is False
    ]
    yield "\n".join(lines)
    if len(comparison.laps) > 1:
        laps = [(mine.number, mine.time, its.time, its.time - mine.time) for mine, its in comparison.laps]
        yield render(Table("laps", _LAPS, laps), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        rows: list[tuple[str | float, ...]] = []
        for leg in legs:
            what = "; ".join(one.text for one in leg.differences)
            rows.append((leg.name, leg.other.time, leg.difference, leg.by_way, leg.by_speed, what))
        yield render(Table("legs by time lost", _LEGS, rows), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        yield f"{'1 leg is' if ties == 1 else f'{ties} legs are'} a tie within {TIE_MS} ms"
