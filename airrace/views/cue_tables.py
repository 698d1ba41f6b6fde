"""Cues in words, as a table for people, and as rows for CSV, JSON and data frames."""

import math
from collections.abc import Iterator, Sequence

from airrace.results.cues import Action, Cue, Pull, RollAction
from airrace.views.tables import Cell, Column, Table, Value
from airrace.views.units import RACE, Units

ONCE_ROUND = math.radians(270.0)
"""The angle from which on a roll is described by the angle rolled, rad: both banks would not say it."""


def place_text(cue: Cue, units: Units = RACE) -> str:
    """Return where a cue is, e.g. `52 m before c1`; empty where positions are not known."""
    if not math.isfinite(cue.distance):
        return ""
    if abs(cue.distance) < 5.0:  # m: a wing is as long, and a time has two decimals
        return f"at {cue.passing}"
    side = "before" if cue.distance < 0.0 else "after"
    return f"{abs(cue.distance) * units.per_m:.0f} {units.length} {side} {cue.passing}"


def cue_text(cue: Cue, units: Units = RACE) -> str:
    """Return what is done at a cue, e.g. `roll right 6° -> 88°, 0.4 s; pull to 10 g for 1.9 s, left`."""
    return "; ".join(_action_text(one, units) for one in cue.actions)


def _action_text(action: Action, units: Units) -> str:
    match action:
        case RollAction():
            if action.vertical or abs(action.angle) > ONCE_ROUND:
                rolled = f"by {_degrees(abs(action.angle))}"
            else:
                rolled = f"{_degrees(action.bank_from)} -> {_degrees(action.bank_to)}"
            through = f", through {_through(action)}" if _through(action) else ""
            return f"roll {action.side} {rolled}, {action.duration:.1f} s{through}"
        case Pull():
            verb = "pull" if action.n_z > 0.0 else "push"
            top = ", over the top" if action.over_the_top else ""
            apex = f", apex {_length(action.apex, units)}" if math.isfinite(action.apex) else ""
            load = f"{action.n_z:z.1f}".removesuffix(".0")
            return f"{verb} to {load} g for {action.duration:.1f} s, {action.side}{top}{apex}"
        case _:
            return f"apex {_length(action.height, units)} at {action.time:.2f} s"


def _through(roll: RollAction) -> str:
    if roll.vertical or abs(roll.angle) > ONCE_ROUND:
        return ""
    return "inverted" if roll.inverted else "level" if roll.level else ""


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):z.0f}°"


def _length(metres: float, units: Units) -> str:
    return f"{metres * units.per_m:.0f} {units.length}"


_CUES = (Column("leg to"), Column("at", "s", ".2f"), Column("where"), Column("what the pilot does", wraps=True))
NOTE = "Bank is positive with the right wing down; a pull lasts while the load is above half of its rise."


def cue_table(
    cues: Sequence[Cue],
    title: str = "",
    *,
    begin: float | None = None,
    units: Units = RACE,
    notes: Sequence[str] = (),
    unicode: bool = True,
) -> Table:
    """Return a table of cues for people; a leg is named at its first cue.

    Args:
        cues: in order.
        title: stands above it.
        begin: the time at which a report's clock starts, s, to which a click on a time leads; None without one.
        units: of lengths.
        notes: sentences that belong to it.
        unicode: whether degrees have their sign rather than a word.
    """
    rows: list[tuple[Cell | Value, ...]] = []
    leg = 0
    for cue in cues:
        name = "" if cue.leg.number == leg else cue.leg.name
        at = cue.time if begin is None else Cell(cue.time - begin, time=cue.time - begin)
        text = cue_text(cue, units)
        rows.append((name, at, place_text(cue, units), text if unicode else text.replace("°", " deg")))
        leg = cue.leg.number
    return Table(title, _CUES, rows, notes)


_ACTIONS = (
    *("leg", "lap", "cue", "cue_time_s", "passing", "distance_m", "action", "side", "time_s", "duration_s"),
    *("bank_from_deg", "bank_to_deg", "rolled_deg", "through", "n_z", "turn_deg", "apex_m", "text"),
)


def action_table(cues: Sequence[Cue]) -> Table:
    """Return a row for every action, for CSV, JSON and data frames: SI units, angles in degrees."""
    return Table("", [Column(key=key) for key in _ACTIONS], list(_action_rows(cues)))


def _action_rows(cues: Sequence[Cue]) -> Iterator[tuple[Value, ...]]:
    for number, cue in enumerate(cues, start=1):
        place = (cue.leg.name, cue.leg.lap, number, cue.time, cue.passing, _finite(cue.distance))
        for one in cue.actions:
            text = _action_text(one, RACE)
            match one:
                case RollAction():
                    banks = (math.degrees(angle) for angle in (one.bank_from, one.bank_to, one.angle))
                    values = ("roll", one.side, one.time, one.duration, *banks, _through(one), None, None, None)
                case Pull():
                    through = "the top" if one.over_the_top else ""
                    load = (one.n_z, math.degrees(one.turn), _finite(one.apex))
                    verb = "pull" if one.n_z > 0.0 else "push"
                    values = (verb, one.side, one.time, one.duration, None, None, None, through, *load)
                case _:
                    values = ("apex", "", one.time, one.duration, None, None, None, "", None, None, one.height)
            yield (*place, *values, text)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
