"""The builder of the air of the day, from `environment` and `origin` of a track file."""

import math

from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.inputs.nodes import KeyPath, Reporter
from airrace.inputs.places import Places
from airrace.inputs.track_schema import EnvironmentEntry, ThermalEntry, WindEntry
from airrace.inputs.units import KNOT

WIND: KeyPath = ("environment", "wind")
HECTOPASCAL = 100.0


def build_air(entry: EnvironmentEntry, places: Places) -> Air:
    """Return the air above a track."""
    return Air(
        temperature_offset=entry.temperature_offset_K,
        pressure_offset=entry.pressure_offset_hPa * HECTOPASCAL,
        elevation=places.origin.elevation_m,
        wind=_wind(entry.wind, places.reporter) if entry.wind else None,
        thermals=tuple(_thermal(thermal, index, places) for index, thermal in enumerate(entry.thermals)),
    )


def _wind(entry: WindEntry, reporter: Reporter) -> StaticWind:
    if entry.speed_kt is None and entry.speed_m_s is None:
        reporter.key(WIND, "missing; a wind needs `speed_kt` or `speed_m_s`")
    if entry.speed_kt is not None and entry.speed_m_s is not None:
        reporter.key((*WIND, "speed_m_s"), "the speed is given twice; keep one of `speed_kt` and `speed_m_s`")
    # A key that the profile does not use would have no effect, silently.
    for key, value, profile in (("exponent", entry.exponent, "power"), ("roughness_m", entry.roughness_m, "log")):
        if value is not None and entry.profile != profile:
            reporter.key((*WIND, key), f"belongs to `profile: {profile}`; the profile is {entry.profile}")
    silent = StaticWind(origin=0.0, speed=0.0)
    wind = StaticWind(
        origin=math.radians(entry.from_deg),
        speed=entry.speed_m_s if entry.speed_m_s is not None else (entry.speed_kt or 0.0) * KNOT,
        profile=Profile(entry.profile),
        reference_height=_given(entry.reference_height_m, silent.reference_height),
        exponent=_given(entry.exponent, silent.exponent),
        roughness=_given(entry.roughness_m, silent.roughness),
    )
    if wind.profile is Profile.LOG and wind.reference_height <= wind.roughness:
        reporter.value(
            (*WIND, "reference_height_m"), f"must be above the roughness of {wind.roughness:g} m in a log profile"
        )
    return wind


def _given(value: float | None, silent: float) -> float:
    return silent if value is None else value


def _thermal(entry: ThermalEntry, index: int, places: Places) -> Thermal:
    place = places.point(entry, ("environment", "thermals", index))
    return Thermal(north=place.north, east=place.east, w_star=entry.w_star_m_s, mixing_height=entry.mixing_height_m)
