"""Courses drawn by lot: what the optimiser has to cope with beyond the courses that somebody proposed.

    python scripts/experiments/random_courses.py SEED > tracks/seed.yaml

A course is a walk: from every element the way turns, goes on for a stretch, and the next element stands across it. The
gates, the order and the surroundings are drawn from the distribution below, which was fixed before any of its
courses was flown. It is not there to be narrowed: a course that is hard to fly is a find. One entry has changed since
then: where a quad had a crossing limit of 45 deg it has 40, and none above that from the course, for the language came
to refuse more. That was after flying: no flight was found from the plan for seeds 10, 17 and 22, all with quads, before
the change, and one for each of them since. The text is valid by construction, for every seed.

| what | drawn from |
|---|---|
| form | circuit 55 % (the lap ends with the start gate), out and back 25 %, open course 20 % |
| laps | 1 or 2 alike; an open course has one |
| passings per lap | 4 to 24, uniform; a quad counts twice, a high turn once |
| next piece | level gate 40, pylon 17, knife-edge gate 15, slalom 14, hairpin 8, quad 6 in 100, as far as it fits |
| spacing | 120 to 600 m, uniform; within a slalom 120 to 250 m |
| change of direction to the next element | below 90 deg 65 %, 90 to 180 deg 25 %, 180 to 270 deg 10 %; either way |
| bearing of the next element | half of that change, give or take 15 deg |
| slalom | 3 to 5 pylons at alternating sides, 5 m inside to 10 m outside of their row, which bends 10 deg at most |
| hairpin | a gate, the next one, the first one again in reverse |
| pylon | passed on the outside of the turn 75 %, else on its inside |
| knife-edge gate | right, left, either alike |
| quad | then left, right, either alike; either passing on edge 15 %; its own crossing limit, 20, 30 or 40 deg, 50 % |
| direction of a gate in the file | forward 60 %, reverse 25 %, planned 15 % (of quads, those that go on either way) |
| passing | window 50 %, point 25 %, gate by gate 25 % |
| crossing limit | 45 or 60 deg alike |
| heights | 15 to 40 m, one for the course 80 %, else one for each element |
| high turn | 25 %: one, 80 to 180 m high, anywhere but within a slalom |
| wind | none 20 %, else 0 to 15 m/s from anywhere, constant, power or log alike |
| aircraft | edge540 65 %, pc9 35 % |
| load factor | 8 to 12 in halves; the aircraft's own limit holds besides |
| start speed limit | 200 kt or none alike |
| safety line | 15 %: along one leg, at least 30 m beside it, and with the room that a turn needs |
| crowd | 25 %: a line beside the course, 50 to 150 m to be kept, with the room that a turn needs |

A circuit has to come home: of up to 200 proposals for the next piece the first is taken from which the rest of the
course can reach the start gate, and which stands 60 m or more from everything else; if there is none, the best. So
the closing leg, too, is about 120 to 600 m long."""

import itertools
import json
import math
import random
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

Choice = TypeVar("Choice")

FORMS = {"circuit": 0.55, "out and back": 0.25, "open": 0.20}
PIECES = {"level": 0.40, "pylon": 0.17, "knife-edge": 0.15, "slalom": 0.14, "hairpin": 0.08, "quad": 0.06}
PASSINGS_OF = {"level": 1, "pylon": 1, "knife-edge": 1, "slalom": 3, "hairpin": 3, "quad": 2}
TURNS = {(0.0, 90.0): 0.65, (90.0, 180.0): 0.25, (180.0, 270.0): 0.10}
DIRECTIONS = {"forward": 0.60, "reverse": 0.25, "planned": 0.15}
EDGES = ("right", "left", "either")
SPACING = (120.0, 600.0)
SLALOM_SPACING = (120.0, 250.0)
APART = 60.0  # m, between elements that are no neighbours
PROPOSALS = 200
STRIDE = 350.0  # m, what a piece surely brings a circuit nearer to home


@dataclass(frozen=True)
class Style:
    """What holds over a whole course."""

    aircraft: str
    form: str
    passing: str
    height: int | None


@dataclass(frozen=True)
class Passing:
    """One passing as laid out: where, with which courses the walk arrives and leaves (degrees), how it is written."""

    name: str
    kind: str
    north: float
    east: float
    arriving: float
    leaving: float
    direction: str = ""
    safety_line: str = ""

    @property
    def text(self) -> str:
        """As an item of the course."""
        keys: dict[str, object] = {"gate": self.name}
        if self.direction and self.direction != "forward":
            keys["direction"] = self.direction
        if self.safety_line:
            keys["safety_lines"] = [self.safety_line]
        return flow(keys) if len(keys) > 1 else self.name


@dataclass(frozen=True)
class Piece:
    """Elements as they stand, by name, and their passings in race order."""

    gates: dict[str, dict[str, object]]
    passings: tuple[Passing, ...]


def drawn(rng: random.Random, table: Mapping[Choice, float]) -> Choice:
    """One of a table's keys, by its weight."""
    return rng.choices(list(table), list(table.values()))[0]


def chance(rng: random.Random, probability: float) -> bool:
    return rng.random() < probability


def ahead(north: float, east: float, bearing: float, distance: float) -> tuple[float, float]:
    """A place as seen from another one, in the decimetres that are written; `bearing` in degrees."""
    angle = math.radians(bearing)
    return round(north + distance * math.cos(angle), 1), round(east + distance * math.sin(angle), 1)


def azimuth(degrees: float) -> int:
    """Whole degrees from 0 to 359."""
    return round(degrees) % 360


def flow(value: object) -> str:
    """A mapping, a list or a scalar on one line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {flow(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(flow(one) for one in value) + "]"
    return str(value)


def place(position: tuple[float, float]) -> dict[str, object]:
    return {"north_m": position[0], "east_m": position[1]}


def walk(rng: random.Random, style: Style) -> Piece:
    """All elements; start and lap in race order."""
    wanted = rng.randint(4, 24)
    high_turn = chance(rng, 0.25) and wanted > 4
    start = _gate(rng, "start", "level", (0.0, 0.0), rng.uniform(0.0, 360.0), style)
    if style.form == "out and back":
        course = _out_and_back(rng, start, (wanted - 2 - high_turn) // 2, style)
    else:
        course = _circuit_or_open(rng, start, wanted - 1 - high_turn, style)
    return _with_high_turn(rng, course) if high_turn else course


def _circuit_or_open(rng: random.Random, start: Piece, passings: int, style: Style) -> Piece:
    """The start, so many passings, and the start again or one more gate as a finish."""
    pieces = _pieces(rng, passings, PIECES)
    if style.form == "open":
        return _walk(rng, start, [*pieces, ("level", 1)], style, homeward=False)
    course = _walk(rng, start, pieces, style, homeward=True)
    return Piece(course.gates, (*course.passings, start.passings[0]))


def _out_and_back(rng: random.Random, start: Piece, passings: int, style: Style) -> Piece:
    """Out past so many passings to a gate where the course turns back, and home the same way."""
    kinds = {kind: weight for kind, weight in PIECES.items() if kind != "hairpin"}
    out = _walk(rng, start, [*_pieces(rng, passings, kinds), ("level", 1)], style, homeward=False)
    back = [_reversed(one) for one in reversed(out.passings[:-1])]
    return Piece(out.gates, (*out.passings, *back))


def _reversed(passing: Passing) -> Passing:
    """The same element on the way back. A quad, too, begins with its first pair, whatever follows."""
    turned = {"forward": "reverse", "reverse": "forward"}.get(passing.direction, passing.direction)
    return replace(passing, direction=turned, arriving=passing.leaving + 180.0, leaving=passing.arriving + 180.0)


def _pieces(rng: random.Random, passings: int, table: Mapping[str, float]) -> list[tuple[str, int]]:
    """What stands on the way, with the number of passings each piece makes; so many together."""
    pieces: list[tuple[str, int]] = []
    left = passings
    while left:
        kind = drawn(rng, {kind: weight for kind, weight in table.items() if PASSINGS_OF[kind] <= left})
        size = min(rng.randint(3, 5), left) if kind == "slalom" else PASSINGS_OF[kind]
        pieces.append((kind, size))
        left -= size
    return pieces


def _walk(
    rng: random.Random, start: Piece, pieces: Sequence[tuple[str, int]], style: Style, *, homeward: bool
) -> Piece:
    """The pieces one after the other; `homeward`: so that the start gate can be reached from the last of them."""
    gates, passings = dict(start.gates), list(start.passings)
    for index, (kind, size) in enumerate(pieces):
        still_to_come = len(pieces) - index - 1
        best, least = None, math.inf
        for _ in range(PROPOSALS):
            proposed = _piece(rng, kind, size, passings[-1], len(gates), style)
            excess = _crowding(proposed, passings) + (_excess(proposed, still_to_come) if homeward else 0.0)
            if excess < least:
                best, least = proposed, excess
            if excess == 0.0:
                break
        assert best is not None
        gates |= best.gates
        passings += best.passings
    return Piece(gates, tuple(passings))


def _excess(piece: Piece, still_to_come: int) -> float:
    """How much too far (or, at the end, too near) the start gate is after a piece, m."""
    distance = math.hypot(piece.passings[-1].north, piece.passings[-1].east)
    if still_to_come:
        return max(0.0, distance - STRIDE * (still_to_come + 1))
    return max(0.0, distance - SPACING[1], SPACING[0] - distance)


def _crowding(piece: Piece, before: Sequence[Passing]) -> float:
    """How much too near to what stands already, m."""
    pairs = itertools.product(piece.passings, before)
    return max(0.0, APART - min(math.hypot(a.north - b.north, a.east - b.east) for a, b in pairs))


def _piece(rng: random.Random, kind: str, size: int, here: Passing, number: int, style: Style) -> Piece:
    """The next piece of a walk; its elements are numbered from `number`."""
    turn = rng.uniform(*drawn(rng, TURNS)) * rng.choice((1, -1))
    course = here.leaving + turn
    position = ahead(here.north, here.east, here.leaving + turn / 2.0 + rng.uniform(-15.0, 15.0), rng.uniform(*SPACING))
    match kind:
        case "slalom":
            return _slalom(rng, size, position, course, number, style)
        case "pylon":
            outside = -90.0 if turn > 0.0 else 90.0
            side = course + (outside if chance(rng, 0.75) else -outside)
            return _pylon(rng, f"pylon_{number}", "pylon", position, course, side, style)
        case "quad":
            return _quad(rng, f"quad_{number}", position, course, style)
        case "hairpin":
            first = _gate(rng, f"gate_{number}", "level", position, course, style)
            second = _piece(rng, "level", 1, first.passings[0], number + 1, style)
            return Piece(first.gates | second.gates, (*first.passings, *second.passings, _reversed(first.passings[0])))
        case "knife-edge":
            return _gate(rng, f"knife_{number}", kind, position, course, style, bank=rng.choice(EDGES))
        case _:
            return _gate(rng, f"gate_{number}", kind, position, course, style)


def _own_keys(rng: random.Random, style: Style) -> dict[str, object]:
    """Height and strictness where every element has its own."""
    keys: dict[str, object] = {}
    if style.height is None:
        keys["height_m"] = rng.randint(15, 40)
    if style.passing == "mixed":
        keys["passing"] = rng.choice(("window", "point"))
    return keys


def _gate(
    rng: random.Random,
    name: str,
    kind: str,
    position: tuple[float, float],
    course: float,
    style: Style,
    *,
    fixed: bool = False,
    **more: object,
) -> Piece:
    """A two-pylon gate that the walk passes along its axis, however that is written; `fixed`: never as planned."""
    directions = {one: weight for one, weight in DIRECTIONS.items() if not (fixed and one == "planned")}
    direction = drawn(rng, directions)
    against = direction == "reverse" or (direction == "planned" and chance(rng, 0.5))
    keys: dict[str, object] = {"type": kind, **place(position), "heading_deg": azimuth(course + 180.0 * against)}
    passing = Passing(name, kind, *position, arriving=course, leaving=course, direction=direction)
    return Piece({name: keys | more | _own_keys(rng, style)}, (passing,))


def _quad(rng: random.Random, name: str, position: tuple[float, float], course: float, style: Style) -> Piece:
    """Two pairs of pylons about one centre; with `either` the walk takes it as a turn to the right."""
    then = rng.choice(EDGES)
    more: dict[str, object] = {"then": then}
    for key in ("bank", "second_bank"):
        if chance(rng, 0.15):
            more[key] = rng.choice(EDGES)
    if chance(rng, 0.5):
        more["crossing_max_deg"] = rng.choice((20, 30, 40))
    quad = _gate(rng, name, "quad", position, course, style, fixed=then != "either", **more)
    leaving = course + (-90.0 if then == "left" else 90.0)
    return Piece(quad.gates, (replace(quad.passings[0], leaving=leaving),))


def _pylon(
    rng: random.Random,
    name: str,
    kind: str,
    position: tuple[float, float],
    course: float,
    side: float,
    style: Style,
) -> Piece:
    keys: dict[str, object] = {"type": "pylon", **place(position), "pass_side_deg": azimuth(side)}
    passing = Passing(name, kind, *position, arriving=course, leaving=course)
    return Piece({name: keys | _own_keys(rng, style)}, (passing,))


def _slalom(
    rng: random.Random, size: int, position: tuple[float, float], course: float, number: int, style: Style
) -> Piece:
    """Pylons in a row that bends a little, passed at alternating sides."""
    side = rng.choice((90.0, -90.0))
    gates: dict[str, dict[str, object]] = {}
    passings: list[Passing] = []
    for index in range(size):
        stands = ahead(*position, course + side, rng.uniform(-5.0, 10.0))
        pylon = _pylon(rng, f"slalom_{number + index}", "slalom", stands, course, course + side, style)
        gates |= pylon.gates
        passings += pylon.passings
        course += rng.uniform(-10.0, 10.0) / size
        position = ahead(*position, course, rng.uniform(*SLALOM_SPACING))
        side = -side
    return Piece(gates, tuple(passings))


def _with_high_turn(rng: random.Random, course: Piece) -> Piece:
    """A high turn on one of the legs that are no part of a slalom."""
    passings = course.passings
    legs = [
        index for index in range(1, len(passings)) if not (passings[index - 1].kind == passings[index].kind == "slalom")
    ]
    at = rng.choice(legs)
    before, after = passings[at - 1], passings[at]
    top = Passing("top", "high-turn", before.north, before.east, before.leaving, after.arriving)
    gates = course.gates | {"top": {"type": "high-turn", "height_min_m": rng.randint(80, 180)}}
    return Piece(gates, (*passings[:at], top, *passings[at:]))


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


AIRCRAFT = {"edge540": 0.65, "pc9": 0.35}


def random_course(seed: int, aircraft_folder: str = "../configs") -> str:
    """The track file of a seed (0 or more), as YAML text.

    Args:
        aircraft_folder: of the shipped aircraft, as seen from where the text will be written.
    """
    rng = random.Random(seed)
    aircraft, form = drawn(rng, AIRCRAFT), drawn(rng, FORMS)
    passing = drawn(rng, {"window": 0.50, "point": 0.25, "mixed": 0.25})
    style = Style(aircraft, form, passing, rng.randint(15, 40) if chance(rng, 0.8) else None)
    course = walk(rng, style)
    start, *lap = course.passings
    line = safety_line(rng, course.passings, TURN_ROOM[aircraft]) if chance(rng, 0.15) else None
    if line:
        lap[line[0] - 1] = replace(lap[line[0] - 1], safety_line="line")
    air = wind(rng)
    parts = [
        "schema: airrace/track/1",
        f"name: Generated course {seed}",
        f"notes: drawn by lot, {form}",
        f"aircraft: {json.dumps(f'{aircraft_folder}/{aircraft}.yaml')}",
        *([f"environment: {{wind: {flow(air)}}}"] if air else []),
        f"rules: {flow(rules(rng))}",
        f"gate_defaults: {flow(gate_defaults(rng, style))}",
        "gates:",
        *(f"  {name}: {flow(keys)}" for name, keys in course.gates.items()),
        *(["safety_lines:", f"  line: {flow(line[1])}"] if line else []),
        *(["crowd:", f"  stands: {flow(crowd(rng, course, TURN_ROOM[aircraft]))}"] if chance(rng, 0.25) else []),
        "course:",
        f"  start: {start.name}",
        *([f"  start_direction: {start.direction}"] if start.direction != "forward" else []),
        "  lap:",
        *(f"    - {one.text}" for one in lap),
        *(["  laps: 2"] if form != "open" and chance(rng, 0.5) else []),
    ]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    sys.stdout.write(random_course(int(sys.argv[1])))
