"""The rules of a race in a track file: limits, those of the pilot, margins, a reserve, penalties; presets of seasons.

A preset is a shipped file of the language `airrace/rules/1`.
"""

import math
from collections.abc import Iterator
from functools import cache
from importlib import resources
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from airrace.files.inputs.document import SUFFIX, Document
from airrace.files.inputs.kinds.kind import LANGUAGE_DEFAULTS, GateDefaultsEntry
from airrace.files.inputs.nodes import Reporter, most_similar
from airrace.files.inputs.places import Height
from airrace.files.inputs.schema import Schema, ShorthandSchema, optional, read_entry
from airrace.flights.results.penalties import ENDS_RACE, NONE_KNOWN, Penalties
from airrace.flights.safety.disturbances import PILOT_DELAY
from airrace.model.track.course import ClearanceRule, Course, PilotLimits, Roll, Rules, StartSpeed
from airrace.model.track.element import Element
from airrace.model.track.gates import ElementWithTolerances
from airrace.optimal_control.quantities import Interval
from airrace.procedure.planning.parameters import course_limits, with_margins
from airrace.race import Race

FOLDER = resources.files("airrace.files.inputs") / "presets"

Ends = Literal["none", "start", "finish", "both"]
PilotPreset = Literal["none", "race", "display"]

Level = Annotated[float, Ge(-10), Le(10)]
Distance = Annotated[float, Gt(0), Le(5000)]


class PilotEntry(ShorthandSchema):
    """The limits of a pilot; own keys override those of the preset."""

    what: ClassVar[str] = "the pilot's limits"
    form: ClassVar[str] = "the name of a preset (none, race or display), or a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = "preset"
    preset: PilotPreset | None = optional(
        "whose limits hold where no key here says otherwise; by default race, in files of airrace/track/1 none"
    )
    n_z_min: Annotated[float, Ge(-25), Lt(1)] | None = optional("least load factor all along")
    n_z_min_low: Level | None = optional("least load factor near the ground")
    low_height_m: Annotated[float, Ge(0), Le(5000)] | None = optional(
        "height above the origin up to which that is; above it 0.1 g less is asked for per metre"
    )
    n_z_min_ends: Level | None = optional("least load factor over start and finish")
    gate_onset_max_g_s: Annotated[float, Gt(0), Le(1000)] | None = optional(
        "largest rate of the load factor at gates, pylons, start and finish, either way; the point mass has none"
    )
    gate_roll_rate_max_deg_s: Annotated[float, Gt(0), Le(1000)] | None = optional(
        "largest roll rate at gates, pylons, start and finish, to either side"
    )
    gate_sideslip_max_deg: Annotated[float, Gt(0), Le(45)] | None = optional(
        "largest sideslip at gates, pylons, start and finish, to either side"
    )
    gate_n_y_max: Annotated[float, Gt(0), Le(10)] | None = optional(
        "largest lateral load factor at gates, pylons, start and finish, to either side"
    )
    settled: Ends | None = optional(
        "where the aircraft is settled, as by `start_state` and `finish_state` of the course, whatever these say"
    )
    steady_turn: Ends | None = optional(
        "where there is no roll, and the load factor is that of a steady turn at the bank"
    )
    turn_tolerance_g: Annotated[float, Gt(0), Le(10)] | None = optional(
        "largest deviation from the load factor of that turn, by default 0.5"
    )

    def complete(self, default: PilotPreset) -> "PilotEntry":
        """Return the entry with every number of its preset, by default `default`, that it does not give itself."""
        own = {key: getattr(self, key) for key in self.model_fields_set}
        return PILOT_PRESETS[self.preset or default].model_copy(update=own)

    def build(self) -> PilotLimits:
        """Return the limits of a complete entry."""
        arguments = self.arguments()
        low = LOW_HEIGHT if self.low_height_m is None else self.low_height_m
        return PilotLimits(
            n_z_min=-math.inf if self.n_z_min is None else self.n_z_min,
            n_z_low=-math.inf if self.n_z_min_low is None else self.n_z_min_low,
            low_height=0.0 if self.n_z_min_low is None else low,
            n_z_ends=-math.inf if self.n_z_min_ends is None else self.n_z_min_ends,
            onset=arguments.get("gate_onset_max_g_s", math.inf),
            roll_rate=arguments.get("gate_roll_rate_max_deg_s", math.inf),
            sideslip=arguments.get("gate_sideslip_max_deg", math.inf),
            n_y=arguments.get("gate_n_y_max", math.inf),
            settled_start=self.settled in ("start", "both"),
            settled_finish=self.settled in ("finish", "both"),
            steady_start=self.steady_turn in ("start", "both"),
            steady_finish=self.steady_turn in ("finish", "both"),
            turn_tolerance=0.0 if self.steady_turn in (None, "none") else self.turn_tolerance_g or TURN_TOLERANCE,
        )


TURN_TOLERANCE = 0.5
"""The largest deviation from the load factor of a steady turn, g: a judgement, half of the weight."""
LOW_HEIGHT = 50.0
"""The height that counts as near the ground, m: a judgement, twice that of the pylons of 2014 to 2019 (25 m)."""

# No rule book gives such numbers; they are judgements. Behind them are:
# - roll rate: wings are level within 10 deg at a gate (race rules 2014-2019), and a pilot has "half of a tenth of a
#   second" to stop a roll there (P. McLeod, airrace.redbull.com, What it takes). At 90 and 45 deg/s an error of 0.05 s
#   is 4.5 and 2.3 deg of bank. The aircraft rolls at 420 deg/s (the same page).
# - least load factors: -1 g is discomfort (FAA-AM-72-28, table of tolerances), so no pilot pushes harder, and a race
#   pilot does not push below weightlessness near the ground; a display pilot keeps half of the weight. Over the ends
#   it is no number that a steady turn asks for as well, or the costs of the two limits could not be told apart.
# - sideslip and lateral load factor: a pilot keeps the ball centred; 2 deg and 0.1 g are what little rudder is left.
# - settled ends: no kick of the rudder or push of the stick in the last tenth of a second to win a millisecond.
# - onset: 10 g/s is from level flight to the 10 g of the race in 0.9 s; 5 g/s is half of it.
PILOT_PRESETS: dict[PilotPreset, PilotEntry] = {
    "none": PilotEntry(preset="none"),
    "race": PilotEntry(
        preset="race",
        n_z_min=-1.0,
        n_z_min_low=0.0,
        low_height_m=LOW_HEIGHT,
        n_z_min_ends=0.25,
        gate_onset_max_g_s=10.0,
        gate_roll_rate_max_deg_s=90.0,
        gate_sideslip_max_deg=2.0,
        gate_n_y_max=0.1,
        settled="both",
        steady_turn="start",
        turn_tolerance_g=TURN_TOLERANCE,
    ),
    "display": PilotEntry(
        preset="display",
        n_z_min=-1.0,
        n_z_min_low=0.5,
        low_height_m=LOW_HEIGHT,
        n_z_min_ends=0.75,
        gate_onset_max_g_s=5.0,
        gate_roll_rate_max_deg_s=45.0,
        gate_sideslip_max_deg=2.0,
        gate_n_y_max=0.1,
        settled="both",
        steady_turn="both",
        turn_tolerance_g=TURN_TOLERANCE,
    ),
}
"""The presets of a pilot's limits by name."""


def pilot_name(limits: PilotLimits, preset: str) -> str:
    """Return whose limits these are: the name of the preset that has the same, `NAME, changed`, or `own`.

    Args:
        limits: of a course.
        preset: that its file names; `none` where it names none.
    """
    same = (name for name, entry in PILOT_PRESETS.items() if entry.build() == limits)
    return next(same, "own" if preset == "none" else f"{preset}, changed")


class LimitsEntry(Schema):
    """The limits that a flight must keep to from start to finish."""

    what: ClassVar[str] = "a rule book"
    n_z_max: Annotated[float, Gt(1), Le(25)] | None = optional("the largest load factor")
    n_z_min: Annotated[float, Ge(-25), Lt(1)] = Field(default=-2.0, description="the least load factor")
    C_L_max: Annotated[float, Gt(0), Le(5)] | None = optional("largest lift coefficient, besides the aircraft's own")
    alpha_max_deg: Annotated[float, Gt(0), Le(90)] | None = optional("largest angle of attack")
    alpha_min_deg: Annotated[float, Ge(-90), Lt(90)] | None = optional("least angle of attack")
    roll_rate_max_deg_s: Annotated[float, Ge(10), Le(1000)] | None = optional(
        "largest roll rate to either side, besides the aircraft's own"
    )
    sideslip_max_deg: Annotated[float, Gt(0), Le(45)] | None = optional(
        "largest sideslip to either side, besides the aircraft's own"
    )
    floor_m: Height = Field(default=10.0, description="least height above the origin")
    ceiling_m: Annotated[float, Gt(0), Le(5000)] | None = optional("largest height above the origin")
    start_speed_max_kt: Annotated[float, Ge(50), Le(500)] | None = optional("largest speed at the start")
    start_speed: Literal["ground_speed", "true_airspeed", "indicated_airspeed"] = Field(
        default="ground_speed",
        description="what that is a limit of",
    )
    clearance: Literal["flight", "crossing"] = Field(
        default="flight",
        description="whether the wing keeps clear of all pylons all along the `flight`, or of those of a gate at its "
        "`crossing` alone; measured in either case",
    )
    crowd_distance_m: Distance | None = optional("least distance from every crowd that does not say its own")
    pilot: PilotEntry = Field(default=PilotEntry(), description="what the pilot keeps to besides")


class FoundEntry(Schema):
    """What the search for a reserve has found, as it is stored with the flight."""

    what: ClassVar[str] = "what was found"
    measured: Annotated[float, Ge(0), Le(1)] = Field(description="share of closed-loop flights that break no limit")
    lower: Annotated[float, Ge(0), Le(1)] = Field(description="lower end of its interval of confidence 95 %")
    flights: Annotated[int, Ge(1)] = Field(default=1000, description="number of these flights")
    reached: bool = Field(description="whether that is what was asked for")
    source: str | None = optional("the run along whose flight that was measured, where this one only keeps its margins")


class ReserveEntry(Schema):
    """How probable it is to be that a flight in disturbances breaks no limit of the course."""

    what: ClassVar[str] = "a reserve"
    probability: Annotated[float, Gt(0), Lt(1)] = Field(
        description="that a race has no touch, no missed gate, no over-g and no other breach"
    )
    load_factor: bool = Field(
        default=True, description="whether pulls that count by the penalties of the season are breaches; else excluded"
    )
    gusts: Literal["none", "light", "moderate", "severe"] = Field(
        default="light", description="turbulence of MIL-F-8785C"
    )
    # A reserve is one against gusts alone unless the course names more, for every further disturbance costs race time.
    wind_error_kt: Annotated[float, Ge(0), Le(30)] = Field(
        default=0.0, description="standard deviation of the wind to the north and to the east"
    )
    mass_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the mass")
    power_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the power")
    density_error_percent: Annotated[float, Ge(0), Le(20)] = Field(default=0.0, description="that of the air's density")
    roll_timing_s: Annotated[float, Ge(0), Le(0.2)] = Field(
        default=0.0, description="that of the time by which rolls are late or early"
    )
    delay_s: Annotated[float, Ge(0), Le(1)] = Field(
        default=PILOT_DELAY, description="from what the pilot sees to the stick"
    )
    found: FoundEntry | None = optional("what the search has found; written with its flight")

    def texts(self) -> list[str]:
        """Return what sets this reserve, as `key=value`."""
        values = self.model_dump(exclude_none=True)
        for key, value in values.pop("found", {}).items():
            values[f"found.{key}"] = value
        texts = ["rules.reserve=null"]
        for key, value in values.items():
            texts.append(f"rules.reserve.{key}={str(value).lower() if isinstance(value, bool) else value}")
        return texts


class RulesEntry(LimitsEntry, ShorthandSchema):
    """The rules of a course file; own keys override those of the preset."""

    form: ClassVar[str] = "the name of a preset, or a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = "preset"
    preset: str | None = optional("the season whose rules hold where no key here says otherwise")
    reserve: ReserveEntry | None = optional("how probable a flight in disturbances is to break no limit of the course")


Seconds = Annotated[float, Ge(0), Le(100)] | Literal["dnf"] | None
"""A penalty: seconds that are added, or `dnf` where the race is over."""


class PenaltiesEntry(Schema):
    """The penalties for broken rules, by which flight logs are judged; no optimum depends on them."""

    what: ClassVar[str] = "penalties"
    pylon: Seconds = optional("a wing touches a pylon", alias="pylon_s")
    missed: Seconds = optional("a gate is passed outside of its pylons, or not at all", alias="missed_s")
    too_high: Seconds = optional("a gate is passed above its legal heights", alias="too_high_s")
    too_low: Seconds = optional("a gate is passed below its legal heights", alias="too_low_s")
    bank: Seconds = optional("a gate is passed with another bank than prescribed", alias="bank_s")
    climb: Seconds = optional("a gate is passed climbing or descending too steeply", alias="climb_s")
    manoeuvre: Seconds = optional("a height or an attitude is not reached", alias="manoeuvre_s")
    manoeuvres: dict[str, Seconds] = Field(
        default_factory=dict[str, Seconds],
        alias="manoeuvres_s",
        description="the same of single kinds of elements: `high-turn: 2`",
    )
    start_speed: Seconds = optional("the start is passed too fast", alias="start_speed_s")
    start_speed_end: Annotated[float, Ge(50), Le(500)] | None = optional(
        "the speed at the start from which on the race is over", alias="start_speed_dnf_kt"
    )
    load_factor: Seconds = optional("the load factor is too large", alias="load_factor_s")
    load_factor_from: Annotated[float, Gt(1), Le(25)] | None = optional(
        "the load factor from which that counts, if it is not `n_z_max`", alias="load_factor_g"
    )
    load_factor_time: Annotated[float, Ge(0), Le(10)] = Field(
        default=0.0, alias="load_factor_time_s", description="for how long it has to last"
    )
    load_factor_end: Annotated[float, Gt(1), Le(25)] | None = optional(
        "the load factor above which the race is over at once", alias="load_factor_dnf_g"
    )


class PresetEntry(Schema):
    """A whole preset file."""

    what: ClassVar[str] = "a preset"
    schema_: Literal["airrace/rules/1"] = Field(alias="schema", description="the language of this file")
    source: str = Field(description="where the numbers come from")
    rules: LimitsEntry = Field(description="limits along the flight")
    gate_defaults: GateDefaultsEntry = Field(
        default=GateDefaultsEntry(), description="what gates have that do not say otherwise"
    )
    penalties: PenaltiesEntry = Field(default=PenaltiesEntry(), description="what broken rules cost in a race")


@cache
def preset_names() -> tuple[str, ...]:
    """Return the names of all presets, in alphabetical order."""
    return tuple(sorted(file.name.removesuffix(SUFFIX) for file in FOLDER.iterdir() if file.name.endswith(SUFFIX)))


@cache
def read_preset(name: str) -> PresetEntry:
    """Read a preset that exists.

    Raises:
        InputError: its file is not what it should be.
    """
    file = FOLDER / f"{name}{SUFFIX}"
    return read_entry(PresetEntry, Document(file.name, file.read_text(encoding="utf-8")))[0]


Keys = TypeVar("Keys", bound=Schema)


def with_preset(
    rules: RulesEntry, gate_defaults: GateDefaultsEntry, default_pilot: PilotPreset, reporter: Reporter
) -> tuple[LimitsEntry, GateDefaultsEntry]:
    """Return the rules and gate defaults of a file on top of those of the preset it names.

    The gate defaults are complete but for the range of heights: what neither gives is the language's own. The pilot's
    limits are those of `default_pilot` where neither names a preset of them.
    """
    defaults, names = LANGUAGE_DEFAULTS, preset_names()
    limits: LimitsEntry = rules
    if rules.preset in names:
        preset = read_preset(rules.preset)
        limits, defaults = _overlay(preset.rules, rules), _overlay(defaults, preset.gate_defaults)
    elif rules.preset is not None:
        similar = most_similar(rules.preset, names)
        hint = f" did you mean `{similar}`?" if similar else ""  # and all names: seasons are too alike
        reporter.value(("rules", "preset"), f"unknown preset `{rules.preset}`;{hint} known are {', '.join(names)}")
    return limits.model_copy(update={"pilot": limits.pilot.complete(default_pilot)}), _overlay(defaults, gate_defaults)


def _overlay(below: Keys, above: Schema) -> Keys:
    """Return the keys of `below`, except those that `above` gives itself."""
    own = {key: getattr(above, key) for key in above.model_fields_set if key in type(below).model_fields}
    return below.model_copy(update=own)


def build_rules(entry: LimitsEntry, preset: str | None, reporter: Reporter) -> Rules:
    """Return the limits along the flight; valid only if nothing was reported."""
    if entry.n_z_max is None and preset is None:
        reporter.key(("rules", "n_z_max"), "missing; a rule book needs `n_z_max`: the largest load factor")
    arguments = entry.arguments()
    rules = Rules(
        n_z=Interval.between(entry.n_z_min, entry.n_z_max),
        alpha_A=Interval.between(arguments.get("alpha_min_deg"), arguments.get("alpha_max_deg")),
        C_L=Interval.between(None, entry.C_L_max),
        p=arguments.get("roll_rate_max_deg_s", math.inf),
        beta_A=arguments.get("sideslip_max_deg", math.inf),
        height=Interval.between(entry.floor_m, entry.ceiling_m),
        clearance=ClearanceRule(entry.clearance),
        start_speed=StartSpeed(entry.start_speed),
        pilot=entry.pilot.build(),
    )
    for key, condition in (("low_height_m", "n_z_min_low"), ("turn_tolerance_g", "steady_turn")):
        if getattr(entry.pilot, key) is not None and getattr(entry.pilot, condition) in (None, "none"):
            reporter.value(("rules", "pilot", key), f"has no effect without `{condition}`")
    if rules.alpha_A.empty:
        reporter.value(("rules", "alpha_min_deg"), f"must not exceed `alpha_max_deg`, {entry.alpha_max_deg:g}")
    if rules.height.empty:
        reporter.value(("rules", "ceiling_m"), f"must be above the floor of {entry.floor_m:g} m")
    return rules


def penalties_of(rules: RulesEntry) -> Penalties:
    """Return the penalties of the preset that the rules of a course name; none are known where they name none."""
    if rules.preset is None or rules.preset not in preset_names():
        return NONE_KNOWN
    preset = read_preset(rules.preset)
    values = preset.penalties.arguments()
    values["manoeuvres"] = {name: _penalty(value) for name, value in preset.penalties.manoeuvres.items()}
    return Penalties(**{name: _penalty(value) for name, value in values.items()}, source=preset.source)


def _penalty(value: Any) -> Any:  # Any: values of a document that was validated
    return ENDS_RACE if value == "dnf" else value


Margin = Annotated[float, Ge(0), Le(5000)]


class MarginsEntry(Schema):
    """By how much limits of the course are tighter, each in the unit of its key."""

    what: ClassVar[str] = "margins"
    rules: dict[str, Margin] = Field(default={}, description="from limits of the rules, e.g. `floor_m: 2`")
    gates: dict[str, dict[str, Margin]] = Field(
        default={}, description="from tolerances of gates, by name, e.g. `g3: {clearance_m: 0.5}`"
    )
    crowd: dict[str, dict[str, Margin]] = Field(default={}, description="from distances of crowds, by name")
    safety_lines: dict[str, dict[str, Margin]] = Field(default={}, description="from safety lines, by name")
    obstacles: dict[str, dict[str, Margin]] = Field(default={}, description="from clearances of obstacles, by name")

    def by_key(self) -> dict[str, float]:
        """Return the margins by the keys of the limits, e.g. `gates.g3.clearance_m`."""
        by_key = {f"rules.{key}": margin for key, margin in self.rules.items()}
        for part in ("gates", "crowd", "safety_lines", "obstacles"):
            for name, margins in getattr(self, part).items():
                by_key |= {f"{part}.{name}.{key}": margin for key, margin in margins.items()}
        return by_key


def tighten(race: Race, entry: MarginsEntry, reporter: Reporter) -> Race:
    """Return a race with the margins of its track; valid only if nothing was reported."""
    margins = entry.by_key()
    limits = sorted({limit.key for limit in course_limits(race) if math.isfinite(limit.value)})
    for key in margins:
        if key not in limits:
            group = key.rpartition(".")[0]
            siblings = ", ".join(f"`{limit}`" for limit in limits if limit.rpartition(".")[0] == group)
            hint = f"known there are {siblings}" if siblings else "the course has no limits there"
            reporter.value(("margins", *key.split(".")), f"is no limit that a flight could keep a margin from; {hint}")
            return race
    tighter = with_margins(race, margins)
    if margins:
        for path, reason in _without_room(tighter.course):
            reporter.value(("margins", *path), reason)
    return tighter


def _without_room(course: Course) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the paths of margins that are too large, and why they are."""
    rules, none_left = course.rules, "the margins leave no room between the limits"
    if rules.height.empty or rules.n_z.upper <= 1.0 or rules.n_z.lower >= 1.0 or rules.C_L.upper <= 0.0:
        yield ("rules",), none_left
        return
    for passage in course.passages:
        text = height_conflict(passage.element, passage.roll, rules.height)
        if text:
            yield ("rules",), f"the margins leave no room: `{passage.element.base_name}` {text}"
            break  # the others would say the same of the same margins
    for element in {passage.element.name: passage.element for passage in course.passages}.values():
        conditions = element.conditions(element.axis or 0.0).values()
        angles = (
            (element.tolerances.bank, element.tolerances.crossing) if isinstance(element, ElementWithTolerances) else ()
        )
        if any(bounds.empty for bounds in conditions) or any(angle <= 0.0 for angle in angles):
            yield ("gates", element.base_name), none_left


def height_conflict(element: Element, roll: Roll | None, band: Interval) -> str:
    """Return why an element cannot be reached between floor and ceiling; empty if it can.

    Args:
        element, roll: of a passage; the roll gains height.
        band: heights between floor and ceiling, m.
    """
    heights = element.heights
    if band.empty or heights.empty:
        return ""
    if heights.intersect(band).empty:
        return f"lies at {_range(heights)}, outside of the race's heights of {_range(band)} (rules: floor, ceiling)"
    if roll is not None and roll.gain > band.upper - band.lower:
        return f"gains {roll.gain:g} m, more than there is between floor and ceiling, {band.upper - band.lower:g} m"
    return ""


def _range(heights: Interval) -> str:
    if heights.lower == heights.upper:
        return f"{heights.lower:g} m"
    if math.isinf(heights.upper):
        return f"{heights.lower:g} m or above"
    if math.isinf(heights.lower):
        return f"{heights.upper:g} m or below"
    return f"{heights.lower:g} to {heights.upper:g} m"


def check_reserve(reserve: ReserveEntry | None, margins: MarginsEntry, race: Race, reporter: Reporter) -> None:
    """Report a reserve that cannot be searched for."""
    if reserve is None or reserve.found is not None:
        return
    if margins.by_key():
        reporter.value(("margins",), "a reserve finds its own margins; leave out either these or `rules.reserve`")
    if race.course.rules.clearance is ClearanceRule.CROSSING:
        message = "needs `clearance: flight`: by `crossing` a wing may touch pylons right before and after its gates"
        reporter.value(("rules", "reserve"), message)
