"""Two flights on one clock, told in a few sentences and a table of legs."""

from collections.abc import Iterator

from rich.table import Table
from rich.text import Text

from airrace.cli.tables import PAGE, plain_table, rendered
from airrace.results.comparison import TIE, Comparison, LegComparison, conditions

IN_MILLISECONDS = round(1000.0 * TIE)


def comparison_texts(comparison: Comparison, *, every: bool) -> Iterator[str]:
    """Yield the verdict and the conditions, then the legs with those first on which most is lost.

    Args:
        comparison: of a flight with the reference.
        every: whether legs that are ties are listed, too.
    """
    yield "\n".join([_verdict(comparison), *_conditions(comparison)])
    if len(comparison.laps) > 1:
        yield rendered(_laps_table(comparison), columns=PAGE)
    legs = [leg for leg in comparison.by_loss if every or not leg.tie]
    if legs:
        yield rendered(_legs_table(comparison, legs), columns=PAGE)
    ties = len(comparison.legs) - len(legs)
    if ties:
        legs_are = "1 leg is" if ties == 1 else f"{ties} legs are"
        yield f"{legs_are} a tie within {IN_MILLISECONDS} ms"


def _verdict(comparison: Comparison) -> str:
    reference, other = comparison.reference, comparison.other
    times = f"{other.race_time:.3f} s and {reference.race_time:.3f} s"
    if comparison.difference != comparison.difference:
        return f"{other.label} against {reference.label}: one of them does not finish"
    if comparison.tie:
        return f"{other.label} against {reference.label}: a tie within {IN_MILLISECONDS} ms ({times})"
    word = "slower" if comparison.difference > 0.0 else "faster"
    return f"{other.label} against {reference.label}: {abs(comparison.difference):.3f} s {word} ({times})"


def _conditions(comparison: Comparison) -> Iterator[str]:
    reference, other = comparison.reference, comparison.other
    for what, first, second in conditions(reference, other):
        yield f"  {what}: {second} against {first}"
    for flight in (other, reference):
        if flight.source.certified is False:
            yield f"  {flight.label} is {flight.source.verdict}"


def _laps_table(comparison: Comparison) -> Table:
    rows = [
        (str(mine.number), f"{mine.time:.3f}", f"{its.time:.3f}", f"{its.time - mine.time:+.3f}")
        for mine, its in comparison.laps
    ]
    return plain_table("laps", ("lap",), ("reference\ns", "flight\ns", "lost\ns"), rows)


def _legs_table(comparison: Comparison, legs: list[LegComparison]) -> Table:
    """Return a table with one row per leg: its time, what is lost on it, by way and by speed, and what differs."""
    table = plain_table("legs by time lost", ("leg to",), ("time\ns", "lost\ns", "by way\ns", "by speed\ns"), ())
    table.add_column("what differs", overflow="fold")
    for leg in legs:
        table.add_row(
            Text(leg.name),
            f"{leg.other.time:.3f}",
            f"{leg.difference:+.3f}",
            f"{leg.by_way:+.3f}",
            f"{leg.by_speed:+.3f}",
            Text("; ".join(one.text for one in leg.differences)),
        )
    return table
