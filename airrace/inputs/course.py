"""The builder of the course of a track file: its rules, its surroundings, and every passage in the order flown."""

import math

from airrace.inputs.features import Feature
from airrace.inputs.kinds.all_kinds import build_features
from airrace.inputs.nodes import Reporter
from airrace.inputs.order import build_passages
from airrace.inputs.place_schema import OriginEntry
from airrace.inputs.places import Places
from airrace.inputs.presets import with_preset
from airrace.inputs.rules_schema import LimitsEntry
from airrace.inputs.surroundings import build_airspace, build_crowd, build_safety_lines, check_room
from airrace.inputs.track_schema import TrackEntry
from airrace.inputs.units import KNOT, interval, interval_deg, radians_or_none
from airrace.quantities import Interval
from airrace.track.course import Course, EndState, Origin, Rules


def build_course(entry: TrackEntry, reporter: Reporter) -> Course:
    """Return the course of a track file; it is only of use if nothing was reported."""
    limits, gate_defaults = with_preset(entry.rules, entry.gate_defaults, reporter)
    rules = _rules(limits, reporter)
    places = Places(entry.origin, reporter)
    places.check_origin()
    features = build_features(entry.gates, gate_defaults, places)
    for feature in features.values():
        _check_heights(feature, rules.height, reporter)
    crowd = build_crowd(entry.crowd, limits.crowd_distance_m, places)
    airspace = build_airspace(entry.airspace, places)
    check_room(features.values(), crowd, airspace, reporter)
    lines = build_safety_lines(entry.safety_lines, places)
    start_speed = Interval() if limits.start_speed_max_kt is None else Interval(upper=limits.start_speed_max_kt * KNOT)
    return Course(
        name=entry.name,
        passages=build_passages(entry.course, features, lines, start_speed, reporter),
        rules=rules,
        origin=_origin(entry.origin),
        crowd=crowd,
        airspace=airspace,
        start_state=EndState(entry.course.start_state),
        finish_state=EndState(entry.course.finish_state),
    )


def _origin(entry: OriginEntry) -> Origin:
    return Origin(
        latitude=radians_or_none(entry.latitude_deg),
        longitude=radians_or_none(entry.longitude_deg),
        elevation=entry.elevation_m,
    )


def _rules(entry: LimitsEntry, reporter: Reporter) -> Rules:
    if entry.n_z_max is None and reporter.find(("rules", "preset")) is None:
        reporter.key(("rules", "n_z_max"), "missing; a rule book needs `n_z_max`: the largest load factor")
    rules = Rules(
        n_z=interval(entry.n_z_min, entry.n_z_max),
        alpha_A=interval_deg(entry.alpha_min_deg, entry.alpha_max_deg),
        C_L=interval(None, entry.C_L_max),
        p=math.inf if entry.roll_rate_max_deg_s is None else math.radians(entry.roll_rate_max_deg_s),
        beta_A=math.inf if entry.sideslip_max_deg is None else math.radians(entry.sideslip_max_deg),
        height=interval(entry.floor_m, entry.ceiling_m),
    )
    if rules.alpha_A.empty:
        reporter.value(("rules", "alpha_min_deg"), f"must not exceed `alpha_max_deg`, {entry.alpha_max_deg:g}")
    if rules.height.empty:
        reporter.value(("rules", "ceiling_m"), f"must be above the floor of {entry.floor_m:g} m")
    return rules


def _check_heights(feature: Feature, flown: Interval, reporter: Reporter) -> None:
    """Report an element that cannot be reached between floor and ceiling."""
    last = feature.steps[-1]
    heights = last.element.heights
    if flown.empty or heights.empty:
        return
    if heights.intersect(flown).empty:
        reporter.value(
            (*feature.path, last.element.height_key(too_high=heights.lower > flown.upper)),
            f"lies at {_range(heights)}, outside of the flown heights of {_range(flown)} (rules: floor, ceiling)",
        )
    if last.roll is not None and last.roll.gain > flown.upper - flown.lower:
        reporter.value(
            (*feature.path, "height_gain_m"),
            f"is more than there is between floor and ceiling, {flown.upper - flown.lower:g} m",
        )


def _range(heights: Interval) -> str:
    if heights.lower == heights.upper:
        return f"{heights.lower:g} m"
    if math.isinf(heights.upper):
        return f"{heights.lower:g} m or above"
    if math.isinf(heights.lower):
        return f"{heights.upper:g} m or below"
    return f"{heights.lower:g} to {heights.upper:g} m"
