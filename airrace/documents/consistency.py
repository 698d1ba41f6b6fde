"""Whether course and aircraft fit together: what neither file alone can tell."""

import math

from airrace.aircraft.aircraft import Aircraft
from airrace.documents.aircraft import weight_not_carried
from airrace.documents.figures import base_name
from airrace.documents.nodes import Reporter
from airrace.documents.units import KNOT
from airrace.procedure.race import Race
from airrace.track.gates import LEVEL, Gate, Passing


def check_together(race: Race, track: Reporter) -> None:
    """Report in the track what this aircraft cannot do."""
    rules, aircraft = race.course.rules, race.aircraft
    start_speed, slowest = race.course.passages[0].speed.upper, aircraft.envelope.V.lower
    if start_speed <= slowest:
        track.value(
            ("rules", "start_speed_max_kt"),
            f"must be above {slowest / KNOT:.4g} kt, the least speed of {aircraft.name}; is {start_speed / KNOT:.4g}",
        )
    shortfall = "" if math.isinf(rules.C_L.upper) else weight_not_carried(aircraft, rules.C_L.upper)
    if shortfall:
        track.value(("rules", "C_L_max"), shortfall)
    gates = {passage.element.name: passage.element for passage in race.course.passages}
    remarked: set[str] = set()
    for gate in gates.values():
        if isinstance(gate, Gate) and base_name(gate.name) not in remarked and not _fits(gate, aircraft, track):
            remarked.add(base_name(gate.name))


def _fits(gate: Gate, aircraft: Aircraft, track: Reporter) -> bool:
    """Wings level, the wing must fit between the pylons with its clearances."""
    room = gate.width - 2.0 * gate.tolerances.clearance
    if gate.passing is Passing.POINT or gate.bank != LEVEL or room > aircraft.airframe.b:
        return True
    track.value(
        ("gates", base_name(gate.name), "width_m"),
        f"a width of {gate.width:g} m less two clearances of {gate.tolerances.clearance:g} m leaves {room:g} m; "
        f"the wing of {aircraft.name} spans {aircraft.airframe.b:g} m",
    )
    return False
