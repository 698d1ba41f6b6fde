"""What a generated course is flown in: rules, air, and what stands beside it."""

import math
import random
from collections.abc import Sequence

from generated_walks import Passing, Piece, Style, ahead, chance, place

PROFILES = ("constant", "power", "log")
TURN_ROOM = {"edge540": 120.0, "pc9": 250.0}  # m, that a turn of a right angle needs
MARGIN = 20.0  # m more, between that room and the crowd


def rules(rng: random.Random) -> dict[str, object]:
    rules: dict[str, object] = {"n_z_max": rng.randint(16, 24) / 2.0, "n_z_min": -2, "floor_m": 10}
    return rules | ({"start_speed_max_kt": 200} if chance(rng, 0.5) else {})


def gate_defaults(rng: random.Random, style: Style) -> dict[str, object]:
    defaults: dict[str, object] = {"width_m": 13, "clearance_m": 0.5, "crossing_max_deg": rng.choice((45, 60))}
    if style.height is not None:
        defaults["height_m"] = style.height
    return defaults | ({"passing": style.passing} if style.passing != "mixed" else {})


def wind(rng: random.Random) -> dict[str, object]:
    """A wind as it is written; empty in still air."""
    if chance(rng, 0.2):
        return {}
    profile = rng.choice(PROFILES)
    wind: dict[str, object] = {"from_deg": rng.randint(0, 359), "speed_m_s": round(rng.uniform(0.0, 15.0), 1)}
    if profile == "constant":
        return wind
    wind |= {"profile": profile, "reference_height_m": rng.choice((10, 20, 50))}
    if profile == "power":
        return wind | {"exponent": round(rng.uniform(0.10, 0.20), 2)}
    return wind | {"roughness_m": rng.choice((0.001, 0.01, 0.05))}


def _room(passing: Passing, towards: float, turn_room: float) -> float:
    """What a turn into or out of a passing may need in the direction `towards` (degrees), m."""
    courses = (passing.arriving, passing.leaving)
    return max(turn_room * (1.0 - abs(math.sin(math.radians(course - towards)))) for course in courses)


def safety_line(
    rng: random.Random, passings: Sequence[Passing], turn_room: float
) -> tuple[int, dict[str, object]] | None:
    """A line along one leg: the index of the passing it leads to, and the line as it is written; None without a leg."""
    aside = ("quad", "high-turn")
    legs = [
        index
        for index in range(2, len(passings))
        if not (passings[index - 1].kind == passings[index].kind == "slalom")
        and not (passings[index - 1].kind in aside or passings[index].kind in aside)
    ]
    if not legs:
        return None
    index = rng.choice(legs)
    a, b = passings[index - 1], passings[index]
    along = math.degrees(math.atan2(b.east - a.east, b.north - a.north))
    side, keep = rng.choice(((90.0, "left"), (-90.0, "right")))
    room = max(_room(one, along + side, turn_room) for one in (a, b)) + rng.uniform(30.0, 60.0)
    ends = [place(ahead(one.north, one.east, along + side, room)) for one in (a, b)]
    if chance(rng, 0.5):
        ends.reverse()
        keep = {"left": "right", "right": "left"}[keep]
    return index, {"from": ends[0], "to": ends[1], "keep": keep, "margin_m": rng.choice((0, 10))}


def crowd(rng: random.Random, course: Piece, turn_room: float) -> dict[str, object]:
    """A straight line of people somewhere beside the whole course."""
    towards, distance = float(rng.randint(0, 359)), rng.randint(50, 150)
    along = math.radians(towards)
    standing = [one for one in course.passings if one.kind != "high-turn"]
    reach = max(
        one.north * math.cos(along) + one.east * math.sin(along) + _room(one, towards, turn_room) for one in standing
    )
    across = [one.east * math.cos(along) - one.north * math.sin(along) for one in standing]
    foot = ahead(0.0, 0.0, towards, reach + distance + MARGIN)
    ends = [place(ahead(*foot, towards + 90.0, one)) for one in (min(across), max(across))]
    return {"line": ends, "distance_m": distance, "measured": rng.choice(("slant", "over-ground"))}
