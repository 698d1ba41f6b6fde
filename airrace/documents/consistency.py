"""Whether course and aircraft fit together: what neither file alone can tell."""

import math

from airrace.aircraft.aircraft import Aircraft
from airrace.documents.aircraft import weight_not_carried
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
    for gate in gates.values():
        if isinstance(gate, Gate):
            _check_span(gate, aircraft, track)


def _check_span(gate: Gate, aircraft: Aircraft, track: Reporter) -> None:
    """Wings level, the wing must fit between the pylons with its clearances."""
    room = gate.width - 2.0 * gate.tolerances.clearance
    if gate.passing is Passing.WINDOW and gate.bank == LEVEL and room <= aircraft.airframe.b:
        track.value(
            ("gates", gate.name, "width_m"),
            f"a width of {gate.width:g} m less two clearances of {gate.tolerances.clearance:g} m leaves {room:g} m; "
            f"the wing of {aircraft.name} spans {aircraft.airframe.b:g} m",
        )
