"""The tables of a stage's result: gate splits, certificate and the routes that were tried."""

import math
from collections.abc import Sequence

from airrace.optimal_control.certificate import Certificate, Curvature
from airrace.procedure.result import CLEARANCE, GateSplit, SearchReport, StageResult, Status
from airrace.quantities import KNOT
from airrace.results.clearances import NEAR_MISS
from airrace.views.tables import Cell, Column, Table

_SPLITS = (
    Column("gate", key="passage"),
    Column("time", "s", ".3f", "time_s"),
    Column("leg", "s", ".3f", "leg_s"),
    Column("speed", "m/s", ".1f", "V_K_m_s"),
    Column("speed", "kt", ".1f", "V_K_kt"),
    Column("height", "m", ".1f", "height_m"),
    Column("load", "g", "z.2f", "n_z"),
    Column("bank", "deg", "z.1f", "bank_deg"),
    Column("climb", "deg", "z.1f", "climb_deg"),
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


_CERTIFICATE = (
    Column("item"),
    Column("value", form=".3g"),
    Column("limit", form=".3g"),
    Column("unit"),
    Column("holds"),
    Column("worst at", wraps=True),
)


def certificate_table(certificate: Certificate, title: str, notes: Sequence[str] = ()) -> Table:
    """Return a table of all items with their limits, angles in degrees, and where a value that is not zero is worst."""
    rows: list[tuple[Cell | str | float, ...]] = []
    for item in certificate.items:
        turned = item.unit in ("rad", "rad/s")
        factor, unit = (math.degrees(1.0), item.unit.replace("rad", "deg")) if turned else (1.0, item.unit)
        holds = Cell("yes") if item.holds else Cell("NO", bad=True)
        where = item.where if item.value else ""
        rows.append((item.name, factor * item.value, factor * item.limit, unit, holds, where))
    judged = [] if certificate.second_order is None else [f"Curvature: {certificate.second_order}."]
    return Table(title, _CERTIFICATE, rows, [*notes, *judged])


_SEARCH = (
    Column("route", wraps=True),
    Column("rough time", "s", ".3f"),
    Column("behind", "s", "+.3f"),
    Column("evaluated by"),
)


LIMITS_OF_CLAIM = (
    "It is a local optimum: small changes gain nothing, as far as first and second derivatives tell; "
    "another route may be faster.",
    "The routes are those that the search evaluated on a coarse mesh; it says nothing of those that it did not try.",
    "The limits are those of course, rules and aircraft, in the air of the inputs.",
    "The aircraft is the model of this stage, as true as its numbers.",
    "Limits are reached, so the flight has no reserve for gusts, for delay or for errors of the pilot.",
)
"""What the claim of a stage does not say, a sentence each."""


def claim(results: Sequence[StageResult]) -> str:
    """Return what is claimed of the last of some stages; empty where it does not hold.

    It says e.g. `certified: a local minimum, all limits measured, the best of 23 routes`.

    Args:
        results: the stage and those before it, of which the last one that searched tells how many routes there were.
    """
    if not results or not results[-1].holds:
        return ""
    certified = results[-1].status is Status.CERTIFIED
    verdict, meshes = ("certified", "") if certified else ("solved", " on one mesh")
    count = next((len(one.search.routes) for one in reversed(results) if one.search.routes), 1)
    routes = f"the best of {count} routes" if count > 1 else "no other route was evaluated"
    optimum, touched = _optimum(results[-1].certificate), _touches(results[-1].certificate)
    return f"{verdict}: {optimum}, all limits measured{meshes}, {routes}{touched}"


def _optimum(certificate: Certificate | None) -> str:
    """Return what an optimum that holds is, as far as its curvature tells."""
    judged = None if certificate is None else certificate.second_order
    if judged is None or judged.hangs_on_weak_limits:
        return (
            "a local optimum"
            if judged is None
            else "a local optimum, a minimum as far as limits that are weakly active hold"
        )
    if judged.curvature is Curvature.POSITIVE:
        return "a local minimum"
    return f"a local minimum but for changes that cost next to nothing, as of the {judged.quantity} on {judged.phase}"


def _touches(certificate: Certificate | None) -> str:
    """Return the sentence on a clearance from pylons that is missed and does not decide; empty where there is none."""
    items = () if certificate is None else certificate.items
    missed = next((one.value for one in items if one.name == CLEARANCE and math.isinf(one.limit)), 0.0)
    text = f"; beside its crossings the wing misses its clearance from a pylon by {missed:.2f} m"
    return text if missed >= NEAR_MISS else ""


def search_table(search: SearchReport, title: str = "", most: int | None = None, notes: Sequence[str] = ()) -> Table:
    """Return a table of the best route and those that came next, on a coarse mesh.

    Args:
        search: of a stage.
        title: empty for one that tells how many routes were tried.
        most: routes to be listed; None for all.
        notes: sentences that belong to it.
    """
    best, starts = search.converged_to_best, search.converged_to_best + search.converged_elsewhere + search.failed
    tried = f"routes: {len(search.routes)} tried in {search.seconds:.1f} s"
    rows: list[tuple[str | float, ...]] = [
        (route.text, route.race_time, "best" if number == 0 else route.difference, route.evaluated_by)
        for number, route in enumerate(search.routes[:most])
    ]
    if len(rows) < len(search.routes):
        rows.append((f"and {len(search.routes) - len(rows)} more", "", "", ""))
    return Table(title or f"{tried}, {best} of {starts} multistarts converged to the best", _SEARCH, rows, notes)
