"""Aircraft of one's own: files estimated from a flight manual, and the comparison of an aircraft with its manual."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from airrace.aircraft.aircraft import Aircraft
from airrace.dynamics.estimation import ManualFigures, estimate
from airrace.dynamics.performance import performance, under
from airrace.errors import UsageError
from airrace.inputs import measures
from airrace.inputs.aircraft_file import aircraft_text, read_aircraft_file
from airrace.inputs.document import SUFFIX
from airrace.quantities import DEGREE, KNOT
from airrace.records import record
from airrace.runs.output import ensure_free, write_text
from airrace.views.tables import Column, Table

MEASURES = {
    **dict.fromkeys(("mass", "manual_mass"), measures.MASS),
    "span": measures.LENGTH,
    "area": measures.AREA,
    **dict.fromkeys(("power", "manual_power"), measures.POWER),
    **dict.fromkeys(("stall", "speed_max", "roll_speed", "speed_limit"), measures.SPEED),
    "climb": measures.CLIMB,
    "roll_rate": measures.ROLL_RATE,
    **dict.fromkeys(("n_z", "turn"), measures.LOAD_FACTOR),
    "n_z_min": measures.NEGATIVE_LOAD_FACTOR,
}
"""The measures of a flight manual's figures."""

_COLUMNS = (
    Column("figure", key="figure"),
    Column("unit", key="unit"),
    Column("published", form=".1f", key="published"),
    Column("computed", form=".1f", key="computed"),
    Column("difference", "%", "+z.1f", key="difference_percent"),
)


@record
class ComparedAircraft:
    """An aircraft beside what is published of it; `path` is its file, None for one that existed."""

    path: Path | None
    aircraft: Aircraft
    figures: ManualFigures

    @property
    def table(self) -> Table:
        """Published and computed figures, at the manual's mass and power."""
        manual = under(self.aircraft, self.figures.manual_mass, self.figures.manual_power)
        conditions = f"{manual.airframe.m:.0f} kg, {manual.propulsion.P_max / 1000.0:.0f} kW, sea level, ISA"
        return Table(f"{self.aircraft.name}: {conditions}", _COLUMNS, list(self._rows(manual)))

    def _rows(self, manual: Aircraft) -> Iterator[list[str | float | None]]:
        figures, found = self.figures, performance(manual, self.figures.roll_speed)
        rolls = f"roll rate at {(figures.roll_speed or found.V_A) / KNOT:.0f} kt"
        for name, unit, factor, published, computed in (
            ("stall", "kt", KNOT, figures.stall, found.stall),
            ("top speed", "kt", KNOT, figures.speed_max, found.speed_max),
            ("rate of climb", "m/s", 1.0, figures.climb, found.climb),
            (rolls, "deg/s", DEGREE, figures.roll_rate, found.roll_rate),
            ("sustained turn", "g", 1.0, figures.turn, found.turn),
        ):
            given = math.nan if published is None else published / factor
            yield [name, unit, given, computed / factor, 100.0 * (computed / factor / given - 1.0)]


def estimate_aircraft(
    name: str,
    *,
    from_: str | Path | None = None,
    output: str | Path | None = None,
    force: bool = False,
    **figures: str | None,
) -> ComparedAircraft:
    """Estimate an aircraft from its flight manual and write its file, or compare one that exists with its manual.

    Args:
        name: the name of the new aircraft; without `from_` an aircraft that comes along, or a file.
        from_: the aircraft from which it takes what the manual leaves open: one that comes along, or a file.
        output: the file; by default the name in lower case, with underscores and `.yaml`.
        force: whether an existing file is overwritten.
        figures: texts with units by the names of the command's options, e.g. `stall="57kt"`, `speed_max="343km/h"`.

    Raises:
        UsageError: a figure is no measure, or no aircraft has these figures; or the file exists.
        InputError: there is no such aircraft.
        StorageError: the folder does not exist or takes no files.
    """
    given = {key: text for key, text in figures.items() if text is not None}
    if unknown := sorted(given.keys() - MEASURES.keys()):
        raise UsageError(f"there is no figure {unknown[0]!r}; known are {', '.join(MEASURES)}")
    read = {key: measures.parse(text, MEASURES[key], f"--{key.replace('_', '-')}") for key, text in given.items()}
    manual = ManualFigures(**read)
    if from_ is None:
        if read or output is not None:
            raise UsageError("an aircraft is made of another one: name that, too, e.g. --from edge540")
        known = read_aircraft_file(name)
        return ComparedAircraft(None, known.aircraft, known.published)
    if not read:
        raise UsageError("no figure of the aircraft is given, e.g. --stall 57kt; without any it is the template")
    path = Path(output) if output is not None else Path(name.lower().replace(" ", "_") + SUFFIX)
    ensure_free(path, force=force, sources=[from_])
    template = read_aircraft_file(from_)
    aircraft, relations = estimate(template.aircraft, manual, name)
    engine, airframe = aircraft.propulsion, aircraft.airframe
    manual = replace(
        manual, manual_mass=manual.manual_mass or airframe.m, manual_power=manual.manual_power or engine.P_max
    )
    write_text(path, aircraft_text(template, Path(from_).stem, aircraft, relations, manual))
    return ComparedAircraft(path, aircraft, manual)
