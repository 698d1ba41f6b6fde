"""The numbers that `--set` reaches, with their present values: given by the files, by presets, or by the language."""

from collections.abc import Iterator, Mapping
from typing import cast

from airrace.environment.air import Profile, StaticWind
from airrace.inputs.features import Feature
from airrace.inputs.kinds.all_kinds import build_features
from airrace.inputs.kinds.defaults import GateDefaultsEntry, PassingEntry
from airrace.inputs.kinds.entry import KindEntry
from airrace.inputs.kinds.passing import (
    BANK_TOLERANCE_DEG,
    CLIMB_MAX_DEG,
    CROSSING_MAX_DEG,
    GATE_CLEARANCE_M,
    HEIGHT_BAND_M,
    HEIGHT_M,
    REACH_M,
    WIDTH_M,
)
from airrace.inputs.nodes import KeyPath, Reporter, dotted
from airrace.inputs.places import Places
from airrace.inputs.presets import with_preset
from airrace.inputs.rules_schema import LimitsEntry
from airrace.inputs.schema import Schema
from airrace.inputs.track_schema import EnvironmentEntry, TrackEntry, WindEntry


def numbers(entry: Schema, path: KeyPath = ()) -> dict[str, float]:
    """Return all numbers of a document by their keys; whole numbers that count (laps) and absent ones are left out."""
    return {dotted(key): value for key, value in _numbers(entry, path)}


def filled_in(entry: TrackEntry, reporter: Reporter) -> TrackEntry:
    """Return a track as if its file gave every number that its preset and the language give it.

    The track must be without fault.
    """
    limits, defaults = with_preset(entry.rules, entry.gate_defaults, reporter)
    features = build_features(entry.gates, defaults, Places(entry.origin, reporter))
    crowds = {
        name: crowd
        if crowd.distance_m is not None
        else crowd.model_copy(update={"distance_m": limits.crowd_distance_m})
        for name, crowd in entry.crowd.items()
    }
    return entry.model_copy(
        update={
            "rules": entry.rules.model_copy(update={key: getattr(limits, key) for key in LimitsEntry.model_fields}),
            "gate_defaults": _defaults(defaults, entry.gates),
            "gates": {name: _element(one, features[name]) for name, one in entry.gates.items()},
            "crowd": crowds,
            "environment": _environment(entry.environment),
        }
    )


def _numbers(value: object, path: KeyPath) -> Iterator[tuple[KeyPath, float]]:
    match value:
        case float():
            yield path, value
        case Schema():
            for key, info in type(value).model_fields.items():
                yield from _numbers(getattr(value, key), (*path, info.alias or key))
        case dict():
            for key, one in cast(dict[str, object], value).items():
                yield from _numbers(one, (*path, key))
        case list():
            for index, one in enumerate(cast(list[object], value)):
                yield from _numbers(one, (*path, index))
        case _:
            return


def _absent(entry: Schema, values: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return those of the values for which the entry has none."""
    return {key: value for key, value in values.items() if getattr(entry, key) is None}


def _defaults(entry: GateDefaultsEntry, gates: Mapping[str, KindEntry]) -> GateDefaultsEntry:
    """Return the defaults of all gates; the heights of windows only where they follow from one nominal height."""
    height = HEIGHT_M if entry.height_m is None else entry.height_m
    silent: dict[str, float | None] = {
        "height_m": HEIGHT_M,
        "clearance_m": GATE_CLEARANCE_M,
        "climb_min_deg": -CLIMB_MAX_DEG,
        "climb_max_deg": CLIMB_MAX_DEG,
        "crossing_max_deg": CROSSING_MAX_DEG,
        "width_m": WIDTH_M,
        "bank_tolerance_deg": BANK_TOLERANCE_DEG,
        "reach_m": REACH_M,
    }
    if not any(isinstance(gate, PassingEntry) and gate.height_m is not None for gate in gates.values()):
        silent |= {"height_min_m": max(0.0, height - HEIGHT_BAND_M), "height_max_m": height + HEIGHT_BAND_M}
    return entry.model_copy(update=_absent(entry, silent))


def _element(entry: KindEntry, feature: Feature) -> KindEntry:
    """Return an element with the numbers that it has in the end."""
    return entry.model_copy(update=_absent(entry, entry.silent_numbers(feature)))


def _environment(entry: EnvironmentEntry) -> EnvironmentEntry:
    return entry if entry.wind is None else entry.model_copy(update={"wind": _wind(entry.wind)})


def _wind(entry: WindEntry) -> WindEntry:
    """Return a wind with the numbers that its profile uses."""
    silent = StaticWind(origin=0.0, speed=0.0)
    values: dict[str, float | None] = {"reference_height_m": silent.reference_height}
    values |= {"exponent": silent.exponent} if entry.profile == Profile.POWER.value else {}
    values |= {"roughness_m": silent.roughness} if entry.profile == Profile.LOG.value else {}
    return entry.model_copy(update=_absent(entry, values))
