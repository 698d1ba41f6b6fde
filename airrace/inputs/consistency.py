"""The check whether course and aircraft fit together, which neither file alone can tell."""

import math

from airrace.inputs.aircraft import weight_not_carried
from airrace.inputs.features import base_name
from airrace.inputs.nodes import Reporter
from airrace.inputs.units import KNOT
from airrace.planning.race import Race


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
        name, misfit = base_name(gate.name), gate.misfit(aircraft.airframe.b, aircraft.name)
        if misfit is not None and name not in remarked:
            key, text = misfit
            track.value(("gates", name, key), text)
            remarked.add(name)
