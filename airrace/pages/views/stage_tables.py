"""The tables of a flight and its stage: gate splits, certificate, routes, least distances, and what the pilot does."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from airrace.flights.results import Flight
from airrace.flights.results.active_limits import ActiveLimit, active_limits
from airrace.flights.results.clearances import NEAR_MISS, least_distances
from airrace.flights.results.cues import Action, Cue, Pull, RollAction
from airrace.optimal_control.certificate import Certificate, Curvature
from airrace.optimal_control.quantities import KNOT
from airrace.pages.views.tables import RACE, Cell, Column, Table, Units, Value
from airrace.procedure.result import CLEARANCE, HARDLY_SLOWER, GateSplit, NoteKind, SearchReport, StageResult, Status

_SPLITS = (
    Column("gate", key="passage"),
    Column("time", "s", ".3f", "time_s"),
    Column("leg", "s", ".3f", "leg_s", rank=4),
    Column("speed", "m/s", ".1f", "V_K_m_s", rank=1),
    Column("speed", "kt", ".1f", "V_K_kt"),
    Column("height", "m", ".1f", "height_m"),
    Column("load", "g", "z.2f", "n_z", rank=5),
    Column("bank", "deg", "z.1f", "bank_deg", rank=3),
    Column("climb", "deg", "z.1f", "climb_deg", rank=2),
    Column(key="heading_deg"),
)


def splits_table(splits: Sequence[GateSplit], title: str = "gate splits") -> Table:
    """Return a table of the passings; `leg` is the time since the passing before, of the first one since the start."""
    befores = (0.0, *(split.time for split in splits))
    rows = [
        (
            split.name,
            split.time,
            split.time - before,
            split.V_K,
            split.V_K / KNOT,
            split.height,
            split.n_z,
            math.degrees(split.bank),
            math.degrees(split.climb),
            round(math.degrees(split.heading), 7) % 360.0,
        )
        for split, before in zip(splits, befores, strict=False)
    ]
    return Table(title, _SPLITS, rows)


_VALUE = Column("value", form=".3g", key="value")
_CERTIFICATE = (
    Column("item", key="name"),
    _VALUE,
    Column("limit", form=".3g", key="limit", rank=3),
    Column("unit", key="unit", rank=2),
    Column("holds", key="holds"),
    Column("worst at", key="where", wraps=True, rank=1),
)


def certificate_table(certificate: Certificate, title: str, notes: Sequence[str] = ()) -> Table:
    """Return a table of all items with their limits, angles in degrees, and where a value that is not zero is worst."""
    rows: list[tuple[Cell | Value, ...]] = []
    for item in certificate.items:
        value, limit, unit = Cell(item.value), Cell(item.limit), Cell(item.unit)
        if item.unit in ("rad", "rad/s"):
            value = Cell(item.value, text=_VALUE.text(math.degrees(item.value)))
            limit = Cell(item.limit, text=_VALUE.text(math.degrees(item.limit)))
            unit = Cell(item.unit, text=item.unit.replace("rad", "deg"))
        holds = Cell(bool(item.holds), text="yes" if item.holds else "NO", bad=not item.holds)
        rows.append((item.name, value, limit, unit, holds, Cell(item.where, text=item.where if item.value else "")))
    curvature = [] if certificate.second_order is None else [f"Curvature: {certificate.second_order}."]
    return Table(title, _CERTIFICATE, rows, [*notes, *curvature])


ONE_MESH = "on one mesh; no second mesh has confirmed the race time"
ROUGH = "as closely as the next stage needs; a race time may be a few hundredths of a second too long"


_STAGES = (
    Column("stage"),
    Column("status", wraps=True),  # of two words, which a narrow terminal puts below each other
    Column("time", "s", ".3f"),
    Column("cost", "s", "+z.3f", rank=4),
    Column("regul.", "s", ".3f", rank=2),
    Column("track.", "m", ".2f", rank=1),
    Column("iter.", form="d", rank=3),
    Column("wall", "s", ".1f", rank=3),
)


def stages_table(results: Sequence[StageResult]) -> Table:
    """Return a table of the finished stages; `cost` is what a fidelity adds to the optimum before it that holds."""
    rows: list[tuple[Cell | str | float | None, ...]] = []
    before: float | None = None
    for result in results:
        race_time, provenance = result.trajectory.race_time, result.provenance
        optimum = result.has_race_time
        sound = result.status in (Status.CERTIFIED, Status.SOLVED, Status.GUESS)
        status = "NOT certified" if result.status is Status.NOT_CERTIFIED else result.status.value
        rows.append(
            (
                result.stage.value,
                Cell(status, bad=not sound),
                race_time if optimum else None,
                race_time - before if optimum and before is not None else None,
                provenance.regularisation if optimum else None,
                provenance.tracking_error if provenance.source else None,
                result.iterations,
                result.timings.wall,
            )
        )
        before = race_time if result.holds else before
    solved_results = [result for result in results if result.status is Status.SOLVED]
    rough = ", ".join(result.stage.value for result in solved_results if result.is_rough)
    notes = [f"solved: {ONE_MESH}"] if solved_results else []
    notes += [f"{rough}: {ROUGH}"] if rough else []
    return Table("stages", _STAGES, rows, notes)


_ROUTE, _BEHIND, _EVALUATED = (
    Column("route", wraps=True),
    Column("behind", "s", "+z.3f"),
    Column("evaluated by", rank=1),
)
NEAR_ROLLS = 0.015
"""The time behind the best within which routes that only roll otherwise share a line, s."""


LIMITS_OF_CLAIM = (
    "It is a local optimum: small changes gain nothing, as far as first and second derivatives tell; "
    "another route may be faster.",
    "The routes are those that the search evaluated on a coarse mesh; it says nothing of those that it did not try.",
    "The limits are those of course, rules and aircraft, in the air of the inputs.",
    "The aircraft is the model of this stage, as true as its numbers.",
    "Limits are reached, so the flight has no reserve for gusts, for delay or for errors of the pilot.",
)
"""What the claim of a stage does not say, a sentence each."""


def verdict_words(result: StageResult) -> str:
    """Return the verdict on a stage in about four words, e.g. `certified: local optimum`, or the items that fail."""
    match result.status:
        case Status.CERTIFIED:
            return "certified: local optimum"
        case Status.SOLVED:
            return (
                "solved on one mesh, as closely as the next stage needs"
                if result.is_rough
                else "solved on one mesh: local optimum"
            )
        case Status.GUESS:
            return "a guess, no optimum"
        case Status.NOT_CERTIFIED:
            failed = [] if result.certificate is None else [item.name for item in result.certificate.failed]
            more = f" and {len(failed) - 2} more" if len(failed) > 2 else ""
            return f"NOT certified{': ' if failed else ''}{', '.join(failed[:2])}{more}"
        case _:
            return f"no flight: {result.status.value}"


def claim(results: Sequence[StageResult]) -> str:
    """Return what is claimed of the last of some stages; empty where it does not hold.

    It says e.g. `certified: a local minimum, all limits measured, the best of 23 routes`, or `the simplest within 10 ms
    of the best of 23 routes` where a faster flight was left for it.

    Args:
        results: the stage and those before it, of which the last one that searched tells how many routes there were.
    """
    if not results or not results[-1].holds:
        return ""
    if results[-1].is_rough:
        return (
            "solved: on one mesh, as closely as the next stage needs; curvature and limits between nodes not measured"
        )
    certified = results[-1].status is Status.CERTIFIED
    verdict, meshes = ("certified", "") if certified else ("solved", " on one mesh")
    count = next((len(result.search.routes) for result in reversed(results) if result.search.routes), 1)
    routes = f"the best of {count} routes" if count > 1 else "no other route was evaluated"
    if _left_faster(results):
        fastest = routes if count > 1 else "the fastest flight"
        routes = f"the simplest within {1e3 * HARDLY_SLOWER:.0f} ms of {fastest}"
    optimum, touched = _optimum(results[-1].certificate), _touches(results[-1].certificate)
    return f"{verdict}: {optimum}, all limits measured{meshes}, {routes}{touched}"


def _left_faster(results: Sequence[StageResult]) -> bool:
    """Tell whether a faster flight was left for that of the last stage, in it or where its route was chosen last."""
    for number in range(len(results) - 1, -1, -1):
        if any(note.kind is NoteKind.SIMPLER_ROUTE for note in results[number].notes):
            return True
        if number and results[number - 1].alternatives:
            return False  # which were flown in this stage, too, so it has chosen anew
    return False


def _optimum(certificate: Certificate | None) -> str:
    """Return what an optimum that holds is, as far as its curvature tells."""
    second_order = None if certificate is None else certificate.second_order
    if second_order is None:
        return "a local optimum"
    if second_order.hangs_on_weak_limits:
        return "a local optimum, a minimum as far as limits that are weakly active hold"
    if second_order.curvature is Curvature.POSITIVE:
        return "a local minimum"
    direction = f"the {second_order.quantity} on {second_order.phase}"
    return f"a local minimum but for changes that cost next to nothing, as of {direction}"


def _touches(certificate: Certificate | None) -> str:
    """Return the sentence on a clearance from pylons that is missed and does not decide; empty where there is none."""
    items = () if certificate is None else certificate.items
    clearance_violation = next((item.value for item in items if item.name == CLEARANCE and math.isinf(item.limit)), 0.0)
    text = f"; beside its crossings the wing misses its clearance from a pylon by {clearance_violation:.2f} m"
    return text if clearance_violation >= NEAR_MISS else ""


def search_table(search: SearchReport, title: str = "", most: int | None = None, notes: Sequence[str] = ()) -> Table:
    """Return a table of the route of the flight and those that came next, on a coarse mesh or refined.

    It is called the best where none is ahead of it there.

    Args:
        search: of a stage that tried routes.
        title: empty for one that tells how many routes were tried.
        most: the largest number of rows of routes; None for any. Routes that only roll otherwise share one.
        notes: sentences that belong to it.
    """
    best, starts = search.converged_to_best, search.converged_to_best + search.converged_elsewhere + search.failed
    first, *further_routes = search.routes
    place = "chosen" if any(route.difference < 0.0 for route in further_routes) else "best"
    rolls = [route for route in further_routes if route.rolls and abs(route.difference) <= NEAR_ROLLS]
    rolls = rolls if len(rolls) > 1 else []
    rows: list[tuple[str | float, ...]] = [(first.text, first.race_time, place, first.evaluated_by)]
    if rolls:
        behind = 1e3 * max(route.difference for route in rolls)
        last = f"{abs(behind):.0f} ms {'ahead' if behind < 0.0 else 'behind'}"
        words = f"{len(rolls)} routes that roll otherwise on a leg, the last of them {last}"
        rows.append((words, rolls[0].race_time, rolls[0].difference, ""))
    distinct_routes = [route for route in further_routes if route not in rolls]
    visible_routes = distinct_routes if most is None else distinct_routes[: max(most - len(rows), 0)]
    rows += [(route.text, route.race_time, route.difference, route.evaluated_by) for route in visible_routes]
    if len(visible_routes) < len(distinct_routes):
        rows.append((f"and {len(distinct_routes) - len(visible_routes)} more", "", "", ""))
    heading, time = f"routes: {len(search.routes)} optimised", "race time"
    if not search.refined:
        heading, time = f"routes: {len(search.routes)} tried in {search.seconds:.1f} s", "rough time"
        heading += f", {best} of {starts} multistarts converged to the {place} one"
    columns = (_ROUTE, Column(time, "s", ".3f", rank=2), _BEHIND, _EVALUATED)
    return Table(title or heading, columns, rows, notes)


_DISTANCES = (
    Column("from", wraps=True),
    Column("least", "m", "z.2f"),
    Column("required", "m", "z.1f", rank=2),
    Column("left", "m", "z.2f"),
    Column("at", "s", "z.2f"),
    Column("height", "m", "z.0f", rank=1),
)


def distance_table(
    flight: Flight, title: str, *, begin: float = 0.0, notes: Sequence[str] = (), units: Units = RACE
) -> Table:
    """Return a row for every thing; none where nothing is known.

    Args:
        flight: of which it is.
        title: stands above it.
        begin: the time that times count from, s.
        notes: sentences that belong to it.
        units: of lengths.
    """
    lengths = {"unit": units.length, "factor": units.per_m}
    columns = [replace(column, **lengths) if column.unit == "m" else column for column in _DISTANCES]
    rows: list[tuple[str | float, ...]] = []
    for clearance in least_distances(flight):
        distances = (clearance.distance, clearance.required, clearance.margin)
        rows.append((clearance.text, *distances, clearance.time - begin, clearance.height))
    return Table(title, columns, rows, notes)


_LIMITS = (
    Column("what limits", wraps=True),
    Column("at"),
    Column("for s", form=".2f"),
    Column("of the race", form=".0%", rank=1),
    Column("most on the leg to", rank=2),
)


def limits_table(flight: Flight, most: int | None = None) -> Table:
    """Return a table of the limits that a flight reaches, those it keeps to for longest first.

    Args:
        flight: an optimum.
        most: the largest number of rows; None for all.
    """
    limits = active_limits(flight)
    rows = [
        (limit.text, _value_text(limit), limit.duration, limit.duration / flight.race_time, limit.leg)
        for limit in limits[:most]
    ]
    return Table("", _LIMITS, rows)


def _value_text(limit: ActiveLimit) -> str:
    """Return the value of a limit with its unit, angles in degrees."""
    if "rad" in limit.unit:
        return f"{math.degrees(limit.value):.4g} {limit.unit.replace('rad', 'deg')}"
    return f"{limit.value:.4g} {'' if limit.unit == '1' else limit.unit}".rstrip()


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
    return "; ".join(_action_text(action, units) for action in cue.actions)


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


_CUES = (Column("leg to"), Column("at", "s", ".2f"), Column("where", rank=1), Column("what the pilot does", wraps=True))
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
        for action in cue.actions:
            text = _action_text(action, RACE)
            match action:
                case RollAction():
                    banks = (math.degrees(angle) for angle in (action.bank_from, action.bank_to, action.angle))
                    when = (action.time, action.duration)
                    values = ("roll", action.side, *when, *banks, _through(action), None, None, None)
                case Pull():
                    through = "the top" if action.over_the_top else ""
                    load = (action.n_z, math.degrees(action.turn), _finite(action.apex))
                    verb = "pull" if action.n_z > 0.0 else "push"
                    values = (verb, action.side, action.time, action.duration, None, None, None, through, *load)
                case _:
                    values = ("apex", "", action.time, action.duration, None, None, None, "", None, None, action.height)
            yield (*place, *values, text)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
