"""The penalties of the season that a course names, as flown logs are judged by them."""

from typing import Literal

from airrace.inputs.presets import preset_names, read_preset
from airrace.inputs.rules_schema import PenaltiesEntry, RulesEntry
from airrace.logs.violations import ENDS_RACE, NONE_KNOWN, Penalties
from airrace.quantities import KNOT


def penalties_of(rules: RulesEntry) -> Penalties:
    """Return the penalties of the preset that the rules of a course name; none are known where they name none."""
    if rules.preset is None or rules.preset not in preset_names():
        return NONE_KNOWN
    preset = read_preset(rules.preset)
    return _penalties(preset.penalties, preset.source)


def _penalties(entry: PenaltiesEntry, source: str) -> Penalties:
    return Penalties(
        pylon=_seconds(entry.pylon_s),
        missed=_seconds(entry.missed_s),
        too_high=_seconds(entry.too_high_s),
        too_low=_seconds(entry.too_low_s),
        bank=_seconds(entry.bank_s),
        climb=_seconds(entry.climb_s),
        manoeuvre=_seconds(entry.manoeuvre_s),
        start_speed=_seconds(entry.start_speed_s),
        start_speed_end=None if entry.start_speed_dnf_kt is None else entry.start_speed_dnf_kt * KNOT,
        load_factor=_seconds(entry.load_factor_s),
        load_factor_from=entry.load_factor_g,
        load_factor_time=entry.load_factor_time_s,
        load_factor_end=entry.load_factor_dnf_g,
        source=source,
    )


def _seconds(value: float | Literal["dnf"] | None) -> float | None:
    return ENDS_RACE if value == "dnf" else value
