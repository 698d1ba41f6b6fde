"""Aircraft of one's own: figures of a flight manual, an aircraft's file made from them, the two compared.

In the file, be it estimated or fitted, every number names the relation it comes from.
"""

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from airrace.errors import InputError, UsageError
from airrace.files.inputs.aircraft import AircraftEntry, PublishedEntry
from airrace.files.inputs.document import AIRCRAFT, SUFFIX, Document
from airrace.files.inputs.inputs import DocumentReader, read_aircraft, read_named
from airrace.files.inputs.jsbsim.aircraft import SET, read_jsbsim_aircraft
from airrace.files.inputs.jsbsim.document import HORSEPOWER, POUND
from airrace.files.inputs.schema import Schema, language_of, si_factor, validate
from airrace.model.aircraft import AerodynamicTables, Aircraft
from airrace.model.dynamics.flight_manual import ManualFigures, Relations, estimate, performance, under
from airrace.optimal_control.quantities import DEGREE, FOOT, KNOT, Interval
from airrace.pages.views.plain_text import one_line
from airrace.pages.views.tables import Column, Table
from airrace.runs.output import ensure_free, write_text

MILE, METRIC_HORSEPOWER = 1609.344, 735.49875
"""The statute mile, m, and 75 metre-kilograms per second, W."""
_MEASURE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*([^\d\s.,+-].*)?")


@dataclass(frozen=True)
class Measure:
    """A kind of measure.

    Attributes:
        units: their SI values; the unit of a kind with only one may be left out.
        allowed: what an aircraft can have, in the first unit.
    """

    units: Mapping[str, float]
    allowed: Interval


_MASS = Measure({"kg": 1.0, "lb": POUND}, Interval(50.0, 50_000.0))
_POWER = Measure({"kW": 1000.0, "hp": HORSEPOWER, "PS": METRIC_HORSEPOWER}, Interval(5.0, 5000.0))
_SPEED = Measure({"kt": KNOT, "km/h": 1.0 / 3.6, "mph": MILE / 3600.0, "m/s": 1.0}, Interval(10.0, 550.0))
_LOAD_FACTOR = Measure({"g": 1.0}, Interval(1.1, 25.0))
MEASURES = {
    **dict.fromkeys(("mass", "manual_mass"), _MASS),
    "span": Measure({"m": 1.0, "ft": FOOT}, Interval(2.0, 60.0)),
    "area": Measure({"m2": 1.0, "ft2": FOOT * FOOT}, Interval(1.0, 500.0)),
    **dict.fromkeys(("power", "manual_power"), _POWER),
    **dict.fromkeys(("stall", "speed_max", "roll_speed", "speed_limit"), _SPEED),
    "climb": Measure({"m/s": 1.0, "ft/min": FOOT / 60.0, "m/min": 1.0 / 60.0}, Interval(0.1, 60.0)),
    "roll_rate": Measure({"deg/s": DEGREE}, Interval(5.0, 1000.0)),
    **dict.fromkeys(("n_z", "turn"), _LOAD_FACTOR),
    "n_z_min": Measure({"g": 1.0}, Interval(-25.0, 0.9)),
}
"""The measures of a flight manual's figures, numbers with a unit: `57kt`, `315 hp`, `3200 ft/min`."""


def read_measure(text: str, measure: Measure, option: str) -> float:
    """Return the measure, in SI units, of a number with its unit; messages call it by its option, e.g. `--stall`.

    Raises:
        UsageError: it is no number, its unit is missing or unknown, or no aircraft has it.
    """
    match, units, first = _MEASURE.fullmatch(text), ", ".join(measure.units), next(iter(measure.units))
    if match is None:
        raise UsageError(f"{option}: {text!r} is no number with a unit ({units})")
    unit = (match[2] or "").strip().lower().replace("\N{SUPERSCRIPT TWO}", "2")
    if not unit and len(measure.units) > 1:
        raise UsageError(f"{option}: {text!r} has no unit; give one of {units}, e.g. {match[1]}{first}")
    factors = {name.lower(): factor for name, factor in measure.units.items()}
    factor = factors.get(unit or first.lower())
    if factor is None:
        raise UsageError(f"{option}: {match[2]!r} is no unit of it; known are {units}")
    value, allowed = float(match[1]) * factor, measure.allowed
    if not allowed.lower <= value / measure.units[first] <= allowed.upper:
        raise UsageError(f"{option}: {text} is beyond {allowed.lower:g} to {allowed.upper:g} {first}")
    return value


_HEAD = """\
# {origin} and {template}.
#
{legend}
#   {template:<14} taken over: nothing that was given says anything about it
#
# Derivatives are per radian; rates are made dimensionless with b/(2 V) (p, r) and cbar/(2 V) (q, alpha-dot).
# A positive deflection makes a negative moment about its own axis.
{remarks}schema: {language}
name: {name}
source: {source}
"""


@dataclass(frozen=True)
class AircraftOrigin:
    """What an aircraft's numbers come from: the start of a sentence, marks and their meanings, a source, and the start
    of the sentence that refuses an aircraft."""

    sentence: str
    marks: tuple[tuple[str, str], ...]
    source: str
    refusal: str = "these figures make"


MANUAL = AircraftOrigin(
    "An aircraft that is estimated from its flight manual",
    (
        ("given", "a figure of the flight manual"),
        ("else", "the relation by which it follows from the figures and the template"),
    ),
    "a flight manual",
)


JSBSIM = AircraftOrigin(
    "An aircraft that is read from JSBSim's XML",
    ((SET, "the number of its file, or made of its functions"), ("else", "the relation by which it follows")),
    "JSBSim's XML",
    "JSBSim's functions and masses make",
)
JSBSIM_SUFFIX = ".xml"


@dataclass(frozen=True)
class AircraftFile:
    """An aircraft file as it is read: what it says, and the aircraft that it makes."""

    entry: AircraftEntry
    aircraft: Aircraft

    @property
    def published(self) -> ManualFigures:
        """The figures that are published of it, SI."""
        published_figures = self.entry.published.arguments() if self.entry.published else {}
        return ManualFigures(**{name: value for name, value in published_figures.items() if name != "source"})


def read_aircraft_file(named: str | Path | Document) -> AircraftFile:
    """Read an aircraft file or the name of a shipped one.

    Raises:
        InputError: it cannot be read, or is no aircraft.
    """
    reader = DocumentReader(())
    mapping = reader.open(read_named(AIRCRAFT, named, reader.findings), "aircraft")
    entry = validate(AircraftEntry, mapping.reporter) if mapping else None
    aircraft = read_aircraft(mapping.reporter) if mapping and entry else None
    if entry is None or aircraft is None or reader.findings:
        raise InputError(reader.findings)
    return AircraftFile(entry, aircraft)


def aircraft_text(
    template: AircraftFile,
    named: str,
    aircraft: Aircraft,
    relations: Relations,
    figures: ManualFigures | None = None,
    origin: AircraftOrigin = MANUAL,
    remarks: Sequence[str] = (),
) -> str:
    """Return the text of the file of an aircraft that was made of a template, with a manual's figures at its end.

    `named` is how the template was called; remarks stand as comments below the head.

    Raises:
        UsageError: it is no aircraft that flies.
    """
    name, source = map(json.dumps, (aircraft.name, f"{origin.source}; what that leaves open, {named}"))
    legend = "\n".join(f"#   {mark:<14} {meaning}" for mark, meaning in origin.marks)
    texts = {"origin": origin.sentence, "legend": legend, "name": name, "source": source, "template": named}
    comments = "".join(f"# Not taken over: {one_line(remark)}\n" for remark in remarks)
    lines = [_HEAD.format(**texts, language=language_of(AircraftEntry), remarks=comments and f"#\n{comments}")]
    for group, entry in template.entry:
        if (
            isinstance(entry, Schema)
            and group not in ("published", "tables")
            and (group != "linear" or aircraft.linear)
        ):
            lines += [f"{group}:", *_align(list(_numbers(group, entry, aircraft, relations, named))), ""]
    lines += [] if aircraft.tables is None else _table_lines(aircraft.tables)
    lines += [] if figures is None else ["published:"]
    for field, info in PublishedEntry.model_fields.items():
        key, value = info.alias or field, getattr(figures, field, None)
        lines += [] if value is None else [f"  {key}: {value / si_factor(key):.6g}"]
    text = "\n".join(lines) + "\n"
    try:
        read_aircraft_file(Document(aircraft.name, text))
    except InputError as error:
        first = error.findings[0]
        message = f"{origin.refusal} no aircraft that flies: {first.key}: {first.message}"
        raise UsageError(message) from error
    return text


def _numbers(
    group: str, entry: Schema, aircraft: Aircraft, relations: Relations, named: str
) -> Iterator[tuple[str, str]]:
    """Yield the keys of a group with their values, and where each comes from."""
    V, n_z, surfaces = aircraft.envelope.V, aircraft.envelope.n_z, aircraft.surfaces
    ends = {"speed_min_m_s": V.lower, "speed_max_m_s": V.upper, "n_z_min": n_z.lower, "n_z_max": n_z.upper}
    ends |= {"elevator_travel_deg": surfaces.eta.upper, "aileron_travel_deg": surfaces.xi.upper}
    ends |= {"rudder_travel_deg": surfaces.zeta.upper}
    for field, info in type(entry).model_fields.items():
        key, value, relation = info.alias or field, getattr(entry, field), relations.get((group, field))
        if value is None:
            continue
        if relation:
            value = (ends[field] if field in ends else getattr(getattr(aircraft, group), field)) / si_factor(key)
        text = f"{value + 0.0:.6g}" if isinstance(value, float) else str(value).lower()
        yield f"  {key}: {text}", relation or named


def _table_lines(tables: AerodynamicTables) -> Iterator[str]:
    """Yield the group of tables."""
    layout = (
        ("lift", tables.lift, {"alpha_deg": DEGREE}, "C_L"),
        ("drag", tables.drag, {"C_L": 1.0, "Re": 1.0}, "C_D"),
        ("thrust", tables.thrust, {"speed_m_s": 1.0, "density_kg_m3": 1.0}, "thrust_N"),
    )
    yield "tables:"
    for name, table, variables, result in layout:
        if table is None:
            continue
        yield f"  {name}:"
        for (variable, factor), knots in zip(variables.items(), table.knots, strict=True):
            yield f"    {variable}: {_row(knot / factor for knot in knots)}"
        rows = ", ".join(_row(row) for row in table.values)
        single = _row(row[0] for row in table.values)
        yield f"    {result}: {single}" if len(variables) == 1 else f"    {result}: [{rows}]"
    yield ""


def _row(values: Iterable[float]) -> str:
    return f"[{', '.join(f'{value:.7g}' for value in values)}]"


def _align(lines: list[tuple[str, str]]) -> Iterator[str]:
    width = max(len(text) for text, _ in lines)
    for text, comment in lines:
        yield f"{text:<{width}}  # {comment}"


_COLUMNS = (
    Column("figure", key="figure"),
    Column("unit", key="unit"),
    Column("published", form=".1f", key="published"),
    Column("computed", form=".1f", key="computed"),
    Column("difference", "%", "+z.1f", key="difference_percent"),
)


@dataclass(frozen=True)
class ComparedAircraft:
    """An aircraft beside what is published of it.

    `path` is its file, None for one that existed; `remarks` say what of a file of JSBSim was not taken over.
    """

    path: Path | None
    aircraft: Aircraft
    figures: ManualFigures
    remarks: Sequence[str] = ()

    @property
    def table(self) -> Table:
        """Published and computed figures, at the manual's mass and power."""
        manual = under(self.aircraft, self.figures.manual_mass, self.figures.manual_power)
        conditions = f"{manual.airframe.m:.0f} kg, {manual.propulsion.P_max / 1000.0:.0f} kW, sea level, ISA"
        return Table(f"{self.aircraft.name}: {conditions}", _COLUMNS, list(self._rows(manual)))

    def _rows(self, manual: Aircraft) -> Iterator[list[str | float | None]]:
        figures, predictions = self.figures, performance(manual, self.figures.roll_speed)
        rolls = f"roll rate at {(figures.roll_speed or predictions.V_A) / KNOT:.0f} kt"
        for name, unit, factor, published, computed in (
            ("stall", "kt", KNOT, figures.stall, predictions.stall),
            ("top speed", "kt", KNOT, figures.speed_max, predictions.speed_max),
            ("rate of climb", "m/s", 1.0, figures.climb, predictions.climb),
            (rolls, "deg/s", DEGREE, figures.roll_rate, predictions.roll_rate),
            ("sustained turn", "g", 1.0, figures.turn, predictions.turn),
        ):
            published_value = math.nan if published is None else published / factor
            computed = (computed or math.nan) / factor  # of a top speed or a turn 0 is none
            yield [name, unit, published_value, computed, 100.0 * (computed / published_value - 1.0)]


def compare_with_manual(
    name: str,
    figures: Mapping[str, str],
    *,
    template: str | Path | None = None,
    output: str | Path | None = None,
    force: bool = False,
) -> ComparedAircraft:
    """Estimate an aircraft from its flight manual and write its file, or compare one that exists with its manual.

    Args:
        name: the name of the new aircraft, or a file of JSBSim (`.xml`) from which it is read; without a template a
            shipped aircraft, or a file.
        figures: texts with units by the keys of `MEASURES`.
        template: the aircraft from which it takes what the manual leaves open: a shipped one, or a file.
        output: the file; by default the name in lower case, with underscores and `.yaml`.
        force: whether an existing file is overwritten.

    Raises:
        UsageError: a figure is no measure, or no aircraft has these figures; or the file exists.
        InputError: there is no such aircraft, or the file of JSBSim holds none.
        StorageError: the folder does not exist or takes no files.
    """
    if name.lower().endswith(JSBSIM_SUFFIX):
        if figures:
            first = next(iter(figures)).replace("_", "-")
            raise UsageError(f"a file of JSBSim says what the aircraft is; use --{first} with --from the file it makes")
        return _from_jsbsim(Path(name), template, output, force=force)
    read = {key: read_measure(text, MEASURES[key], f"--{key.replace('_', '-')}") for key, text in figures.items()}
    manual = ManualFigures(**read)
    if template is None:
        if read or output is not None:
            raise UsageError("an aircraft is made of another one: name that, too, e.g. --from edge540")
        shipped_file = read_aircraft_file(name)
        return ComparedAircraft(None, shipped_file.aircraft, shipped_file.published)
    if not read:
        raise UsageError("no figure of the aircraft is given, e.g. --stall 57kt; without any it is the template")
    path = Path(output) if output is not None else Path(name.lower().replace(" ", "_") + SUFFIX)
    ensure_free(path, force=force, sources=[template])
    source = read_aircraft_file(template)
    aircraft, relations = estimate(source.aircraft, manual, name)
    engine, airframe = aircraft.propulsion, aircraft.airframe
    manual = replace(
        manual, manual_mass=manual.manual_mass or airframe.m, manual_power=manual.manual_power or engine.P_max
    )
    write_text(path, aircraft_text(source, Path(template).stem, aircraft, relations, manual))
    return ComparedAircraft(path, aircraft, manual)


def _from_jsbsim(
    path: Path, template: str | Path | None, output: str | Path | None, *, force: bool
) -> ComparedAircraft:
    """Write the file of an aircraft that is read from JSBSim's."""
    if template is None:
        raise UsageError("JSBSim has no limits of load factor and speed: name an aircraft that has, e.g. --from zlin50")
    target = Path(output) if output is not None else Path(path.stem + SUFFIX)
    ensure_free(target, force=force, sources=[path, template])
    source = read_aircraft_file(template)
    read = read_jsbsim_aircraft(path, source.aircraft)
    try:
        text = aircraft_text(
            source, Path(template).stem, read.aircraft, read.relations, origin=JSBSIM, remarks=read.remarks
        )
    except UsageError as error:
        raise UsageError(f"{error}. Not taken over: {'; '.join(read.remarks)}") from error
    write_text(target, text)
    return ComparedAircraft(target, read.aircraft, ManualFigures(), read.remarks)
