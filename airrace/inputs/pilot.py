"""The limits of a pilot: a part of the rules, as a preset and keys that override it."""

import math
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field

from airrace.inputs.schema import ShorthandSchema, optional
from airrace.track.course import PilotLimits

Level = Annotated[float, Ge(-10), Le(10)]
PresetName = Literal["none", "race", "display"]


class PilotEntry(ShorthandSchema):
    """The limits of a pilot; own keys override those of the preset."""

    what: ClassVar[str] = "the pilot's limits"
    form: ClassVar[str] = "the name of a preset (none, race or display), or a mapping (`key: value` lines)"
    shorthand: ClassVar[str | None] = "preset"
    preset: PresetName = Field(default="none", description="whose limits hold where no key here says otherwise")
    n_z_min_low: Level | None = optional("least load factor near the ground")
    low_height_m: Annotated[float, Ge(0), Le(5000)] | None = optional(
        "height above the origin up to which that is; above it 0.1 g less is asked for per metre"
    )
    n_z_min_ends: Level | None = optional("least load factor over start and finish")
    gate_onset_max_g_s: Annotated[float, Gt(0), Le(1000)] | None = optional(
        "largest rate of the load factor at gates and pylons, either way; the point mass has none"
    )
    gate_roll_rate_max_deg_s: Annotated[float, Gt(0), Le(1000)] | None = optional(
        "largest roll rate at gates and pylons, to either side"
    )
    steady_turn: Literal["none", "start", "finish", "both"] | None = optional(
        "where there is no roll, and the load factor is that of a steady turn at the bank"
    )
    turn_tolerance_g: Annotated[float, Gt(0), Le(10)] | None = optional(
        "largest deviation from the load factor of that turn, by default 0.5"
    )

    def complete(self) -> "PilotEntry":
        """Return the entry as if the file gave every number of the preset."""
        own = {key: getattr(self, key) for key in self.model_fields_set}
        return PRESETS[self.preset].model_copy(update=own)

    def build(self) -> PilotLimits:
        """Return the limits of a complete entry."""
        given, steady = self.arguments(), self.steady_turn
        low = LOW_HEIGHT if self.low_height_m is None else self.low_height_m
        return PilotLimits(
            n_z_low=-math.inf if self.n_z_min_low is None else self.n_z_min_low,
            low_height=0.0 if self.n_z_min_low is None else low,
            n_z_ends=-math.inf if self.n_z_min_ends is None else self.n_z_min_ends,
            onset=given.get("gate_onset_max_g_s", math.inf),
            roll_rate=given.get("gate_roll_rate_max_deg_s", math.inf),
            steady_start=steady in ("start", "both"),
            steady_finish=steady in ("finish", "both"),
            turn_tolerance=0.0 if steady in (None, "none") else self.turn_tolerance_g or TURN_TOLERANCE,
        )


TURN_TOLERANCE = 0.5
"""The largest deviation from the load factor of a steady turn, g: a judgement, half of the weight."""
LOW_HEIGHT = 50.0
"""The height that counts as near the ground, m: a judgement, twice that of the pylons of 2014 to 2019 (25 m)."""

# No rule book gives such numbers; they are judgements. Behind them are:
# - roll rate: wings are level within 10 deg at a gate (race rules 2014-2019), and a pilot has "half of a tenth of a
#   second" to stop a roll there (P. McLeod, airrace.redbull.com, What it takes). At 90 and 45 deg/s an error of 0.05 s
#   is 4.5 and 2.3 deg of bank. The aircraft rolls at 420 deg/s (the same page).
# - least load factors: -1 g is discomfort (FAA-AM-72-28, table of tolerances), so a race pilot does not push below
#   weightlessness near the ground; a display pilot keeps half of the weight. Over the ends it is no number that a
#   steady turn asks for as well, or nobody could tell what each of the two limits costs.
# - onset: 10 g/s is from level flight to the 10 g of the race in 0.9 s; 5 g/s is half of it.
PRESETS = {
    "none": PilotEntry(),
    "race": PilotEntry(
        preset="race",
        n_z_min_low=0.0,
        low_height_m=LOW_HEIGHT,
        n_z_min_ends=0.25,
        gate_onset_max_g_s=10.0,
        gate_roll_rate_max_deg_s=90.0,
        steady_turn="start",
        turn_tolerance_g=TURN_TOLERANCE,
    ),
    "display": PilotEntry(
        preset="display",
        n_z_min_low=0.5,
        low_height_m=LOW_HEIGHT,
        n_z_min_ends=0.75,
        gate_onset_max_g_s=5.0,
        gate_roll_rate_max_deg_s=45.0,
        steady_turn="both",
        turn_tolerance_g=TURN_TOLERANCE,
    ),
}
"""The presets by name."""
