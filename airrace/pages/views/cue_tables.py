"""Cues in words, and their tables: what the pilot does on every leg."""

import math
from collections.abc import Iterator, Sequence

from airrace.flights.results.cues import Cue
from airrace.flights.sensitivity import LatenessPrice
from airrace.pages.views.tables import RACE, Cell, Column, Table, Units, Value

ONCE_ROUND = math.radians(270.0)
"""The angle from which on a roll is described by the angle rolled, rad: both banks would not say it."""
STEADY = 0.3
"""The change of the load factor below which it is held, g: pilots read an accelerometer no better."""
AT_PASSING = 5.0
"""The distance within which a cue is at a passing, m: a wing is as long, and a time has two decimals."""
KNEE_LETTERS = 16
"""The letters of a place that a kneeboard has room for."""
NOTE = (
    "L and R: bank with the left or the right wing down, beyond 90 on the back. A cue begins with the bank and pull "
    "with which the one before it ends; where a mean is told, the pull goes to its extreme and stays there."
)
LATENESS_NOTE = (
    "late, early: the time lost, s, by a cue that begins {delay:g} s too late or too early, flown on as well as can "
    "be; MISS where no flight was found from there that meets all gates and limits."
)
"""With the delay, s."""


def gate_text(name: str) -> str:
    """Return what a map calls the gate of a passing, e.g. `g4` of `2:g4#2`."""
    lap, colon, gate = name.partition(":")
    return (gate if colon and lap.isdigit() else name).partition("#")[0]


def bank_text(bank: float) -> str:
    """Return a bank in words, e.g. `L88`, `R9`, `level`, `inverted`."""
    degrees = round(math.degrees(bank))
    if degrees == 0 or abs(degrees) == 180:
        return "inverted" if degrees else "level"
    return f"{'R' if degrees > 0 else 'L'}{abs(degrees)}"


def course_text(course: float) -> str:
    """Return a course over ground in three digits, e.g. `007`; empty where it has no meaning."""
    return "" if math.isnan(course) else f"{round(math.degrees(course)) % 360:03d}"


def load_text(n_z: float) -> str:
    """Return a load factor without its unit, e.g. `8.3` or `10`."""
    return f"{n_z:z.1f}".removesuffix(".0")


def place_text(cue: Cue, units: Units = RACE) -> str:
    """Return where a cue is, e.g. `52 m before c1`; empty where positions are not known."""
    if not math.isfinite(cue.distance):
        return ""
    gate = gate_text(cue.passing)
    if abs(cue.distance) < AT_PASSING:
        return f"at {gate}"
    side = "before" if cue.distance < 0.0 else "after"
    return f"{abs(cue.distance) * units.per_m:.0f} {units.length} {side} {gate}"


def cue_text(cue: Cue, units: Units = RACE) -> str:
    """Return what is done at a cue, e.g. `roll left R10 to L88 in 0.4 s; pull 2.4 to 8.6 g, mean 5.4 g`."""
    return "; ".join(filter(None, (_bank_words(cue), _pull_words(cue), _apex_words(cue, units))))


def knee_texts(cue: Cue, units: Units) -> tuple[str, ...]:
    """Return a cue in the narrow columns of a kneeboard: number, time, place, bank, pull, height, course out."""
    place = place_text(cue, units).replace(" before ", " bef. ")
    if len(place) > KNEE_LETTERS:  # a long name stands above it already, or below
        distance, _, _ = place.rpartition(" ")
        place = f"{distance} next" if "bef." in place else distance
    begin, end = bank_text(cue.begin.bank), bank_text(cue.end.bank)
    side, through = cue.side[:1].upper(), _through(cue)
    if cue.action == "hold":
        bank = "no roll" if cue.vertical else f"hold {end}"
    elif cue.vertical or abs(cue.rolled) > ONCE_ROUND:
        bank = f"{cue.action} {side} {abs(math.degrees(cue.rolled)):.0f}°"
    elif cue.action == "ease":
        bank = f"ease {end}"
    else:
        bank = f"roll {side} {begin}→{end}{' inv' if through == 'inverted' else ''}"
    n_z = [cue.begin.n_z, cue.n_z_extreme, cue.end.n_z]
    loads = [load_text(value) for value in n_z]
    mean = load_text(cue.n_z_mean)
    pull = "→".join(loads if loads[1] not in (loads[0], loads[2]) else [loads[0], loads[2]])
    pull = mean if max(n_z) - min(n_z) < STEADY else f"{pull} ({mean})"
    height = f"{cue.begin.height * units.per_m:.0f}"
    return str(cue.number), f"{cue.time:.2f}", place, bank, pull, height, course_text(cue.end.course)


def _bank_words(cue: Cue) -> str:
    if cue.action == "hold":
        return "hold, no roll" if cue.vertical else f"hold {bank_text(cue.end.bank)}"
    if cue.vertical or abs(cue.rolled) > ONCE_ROUND:
        return f"{cue.action} {cue.side} by {abs(math.degrees(cue.rolled)):.0f}° in {cue.duration:.1f} s"
    if cue.action == "ease":
        at_passing = cue.end.time == cue.leg.after.time
        when = f"by {gate_text(cue.leg.after.name)}" if at_passing else f"in {cue.duration:.1f} s"
        return f"ease to {bank_text(cue.end.bank)} {when}"
    through = f", through {_through(cue)}" if _through(cue) else ""
    banks = f"{bank_text(cue.begin.bank)} to {bank_text(cue.end.bank)}"
    return f"roll {cue.side} {banks} in {cue.duration:.1f} s{through}"


def _pull_words(cue: Cue) -> str:
    begin, extreme, mean, end = (load_text(n_z) for n_z in (cue.begin.n_z, cue.n_z_extreme, cue.n_z_mean, cue.end.n_z))
    loads = (cue.begin.n_z, cue.n_z_extreme, cue.end.n_z)
    verb = "pull" if cue.n_z_mean > 0.0 else "push"
    if max(loads) - min(loads) < STEADY:
        return f"{verb} {mean} g"
    if extreme in (begin, end):
        return f"{verb} {begin} to {end} g, mean {mean} g"
    peaks = "peaks" if abs(cue.n_z_extreme) > abs(cue.n_z_mean) else "eases to"
    return f"{verb} {begin} g, {peaks} {extreme} g, mean {mean} g over {cue.duration:.1f} s, ends {end} g"


def _apex_words(cue: Cue, units: Units) -> str:
    if cue.apex is None:
        return ""
    top = "over the top, " if cue.apex.over_the_top else ""
    return f"{top}apex {cue.apex.height * units.per_m:.0f} {units.length} at {cue.apex.time:.2f} s"


def _through(cue: Cue) -> str:
    return "inverted" if cue.inverted else "level" if cue.level else ""


def cue_table(
    cues: Sequence[Cue],
    title: str = "",
    *,
    begin: float | None = None,
    units: Units = RACE,
    notes: Sequence[str] = (),
    unicode: bool = True,
    prices: Sequence[LatenessPrice] = (),
) -> Table:
    """Return a table of cues for people; a leg is named at its first cue.

    Args:
        cues: in order.
        prices: of lateness, one per cue; none where they were not asked for.
        title: stands above it.
        begin: the time at which a report's clock starts, s, to which a click on a time leads; None without one.
        units: of lengths.
        notes: sentences that belong to it.
        unicode: whether degrees have their sign rather than a word.
    """
    columns = [
        Column("leg to"),
        Column("cue", form="d"),
        Column("at", "s", ".2f"),
        Column("where", rank=2),
        Column("height", units.length, ".0f", rank=1),
        Column("out on", "deg", rank=3),
        *([Column("late"), Column("early")] if prices else []),
        Column("what the pilot does", wraps=True),
    ]
    if prices:
        notes = [*notes, LATENESS_NOTE.format(delay=prices[0].delay)]
    rows: list[tuple[Cell | Value, ...]] = []
    leg = 0
    for row, cue in enumerate(cues):
        name = "" if cue.leg.number == leg else cue.leg.name
        at = cue.time if begin is None else Cell(cue.time - begin, time=cue.time - begin)
        text = cue_text(cue, units)
        height = cue.begin.height * units.per_m
        text = text if unicode else text.replace("°", " deg")
        price = price_texts(cue, prices[row]) if prices else ()
        rows.append((name, cue.number, at, place_text(cue, units), height, course_text(cue.end.course), *price, text))
        leg = cue.leg.number
    return Table(title, columns, rows, notes)


def price_texts(cue: Cue, price: LatenessPrice) -> tuple[str, str]:
    """Return what a cue costs that is late and one that is early, s, e.g. `0.08` or `MISS`; empty for an early cue at
    the start, which nobody flies."""
    late, early = ("MISS" if lost is None else f"{lost:z.2f}" for lost in (price.late, price.early))
    return late, "" if price.early is None and cue.number == 1 else early


_ROWS = (
    *("leg", "lap", "cue", "time_s", "duration_s", "passing", "distance_m", "action", "side", "vertical"),
    *("bank_from_deg", "bank_to_deg", "rolled_deg", "through"),
    *(
        "n_z_from",
        "n_z_extreme",
        "n_z_mean",
        "n_z_to",
        "height_from_m",
        "height_to_m",
        "course_from_deg",
        "course_to_deg",
    ),
    *("apex_m", "apex_time_s", "over_the_top", "text"),
)


_PRICES = ("delay_s", "late_s", "early_s")


def cue_rows(cues: Sequence[Cue], prices: Sequence[LatenessPrice] = ()) -> Table:
    """Return a row for every cue, for CSV, JSON and data frames: SI units, angles in degrees; with prices of lateness,
    one per cue, where there are any."""
    rows = list(_values(cues))
    if prices:
        rows = [(*values, price.delay, price.late, price.early) for values, price in zip(rows, prices, strict=True)]
    return Table("", [Column(key=key) for key in (*_ROWS, *(_PRICES if prices else ()))], rows)


def _values(cues: Sequence[Cue]) -> Iterator[tuple[Value, ...]]:
    for cue in cues:
        distance = cue.distance if math.isfinite(cue.distance) else None
        banks = (math.degrees(angle) for angle in (cue.begin.bank, cue.end.bank, cue.rolled))
        courses = (None if math.isnan(state.course) else math.degrees(state.course) for state in (cue.begin, cue.end))
        apex = (None, None, False)
        if cue.apex is not None:
            apex = (cue.apex.height, cue.apex.time, cue.apex.over_the_top)
        yield (
            *(cue.leg.name, cue.leg.lap, cue.number, cue.time, cue.duration, cue.passing, distance),
            *(cue.action, cue.side, cue.vertical, *banks, _through(cue)),
            *(cue.begin.n_z, cue.n_z_extreme, cue.n_z_mean, cue.end.n_z, cue.begin.height, cue.end.height),
            *(*courses, *apex, cue_text(cue)),
        )
