"""The rules of a race: in a course file, or as the preset of a season (`airrace/rules/1`)."""

from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field

from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.place_schema import Distance, Height
from airrace.inputs.schema import Schema

RULES_SCHEMA = "airrace/rules/1"


class LimitsEntry(Schema):
    """The limits that a flight must keep to from start to finish."""

    what: ClassVar[str] = "a rule book"
    n_z_max: Annotated[float, Gt(1), Le(25)] | None = Field(default=None, description="the largest load factor")
    n_z_min: Annotated[float, Ge(-25), Lt(1)] = Field(default=-2.0, description="the least load factor")
    C_L_max: Annotated[float, Gt(0), Le(5)] | None = Field(
        default=None, description="largest lift coefficient, besides the aircraft's own"
    )
    alpha_max_deg: Annotated[float, Gt(0), Le(90)] | None = Field(default=None, description="largest angle of attack")
    alpha_min_deg: Annotated[float, Ge(-90), Lt(90)] | None = Field(default=None, description="least angle of attack")
    roll_rate_max_deg_s: Annotated[float, Ge(10), Le(1000)] | None = Field(
        default=None, description="largest roll rate to either side, besides the aircraft's own"
    )
    sideslip_max_deg: Annotated[float, Gt(0), Le(45)] | None = Field(
        default=None, description="largest sideslip to either side, besides the aircraft's own"
    )
    floor_m: Height = Field(default=10.0, description="least height above the origin")
    ceiling_m: Annotated[float, Gt(0), Le(5000)] | None = Field(
        default=None, description="largest height above the origin"
    )
    start_speed_max_kt: Annotated[float, Ge(50), Le(500)] | None = Field(
        default=None, description="largest speed over ground at the start"
    )
    crowd_distance_m: Distance | None = Field(
        default=None, description="least distance from every crowd that does not say its own"
    )


class RulesEntry(LimitsEntry):
    """The rules of a course file; own keys override those of the preset."""

    form: ClassVar[str] = "the name of a preset, or a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = "preset"
    preset: str | None = Field(default=None, description="the season whose rules hold where no key here says otherwise")


Seconds = Annotated[float, Ge(0), Le(100)] | Literal["dnf"] | None
"""A penalty: seconds that are added, or `dnf` where the race is over."""


class PenaltiesEntry(Schema):
    """The penalties for broken rules, by which flown logs are judged; no optimum depends on them."""

    what: ClassVar[str] = "penalties"
    pylon_s: Seconds = Field(default=None, description="a wing touches a pylon")
    missed_s: Seconds = Field(default=None, description="a gate is passed outside of its pylons, or not at all")
    too_high_s: Seconds = Field(default=None, description="a gate is passed above its legal heights")
    too_low_s: Seconds = Field(default=None, description="a gate is passed below its legal heights")
    bank_s: Seconds = Field(default=None, description="a gate is passed with another bank than prescribed")
    climb_s: Seconds = Field(default=None, description="a gate is passed climbing or descending too steeply")
    manoeuvre_s: Seconds = Field(default=None, description="a height or an attitude is not reached")
    start_speed_s: Seconds = Field(default=None, description="the start is passed too fast")
    start_speed_dnf_kt: Annotated[float, Ge(50), Le(500)] | None = Field(
        default=None, description="the speed at the start from which on the race is over"
    )
    load_factor_s: Seconds = Field(default=None, description="the load factor is too large")
    load_factor_g: Annotated[float, Gt(1), Le(25)] | None = Field(
        default=None, description="the load factor from which that counts, if it is not `n_z_max`"
    )
    load_factor_time_s: Annotated[float, Ge(0), Le(10)] = Field(default=0.0, description="for how long it has to last")
    load_factor_dnf_g: Annotated[float, Gt(1), Le(25)] | None = Field(
        default=None, description="the load factor above which the race is over at once"
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
    penalties: PenaltiesEntry = Field(default=PenaltiesEntry(), description="what broken rules cost in a flown race")
