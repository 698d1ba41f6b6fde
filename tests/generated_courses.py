"""Courses drawn by lot: what the optimiser has to cope with beyond the courses that somebody proposed.

    python tests/generated_courses.py SEED > tracks/seed.yaml

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
the closing leg, too, is about 120 to 600 m long.
"""

import json
import random
import sys
from dataclasses import replace

from generated_surroundings import TURN_ROOM, crowd, gate_defaults, rules, safety_line, wind
from generated_walks import FORMS, Style, chance, drawn, flow, walked_course

AIRCRAFT = {"edge540": 0.65, "pc9": 0.35}


def generated_course(seed: int, aircraft_folder: str = "../configs") -> str:
    """The track file of a seed (0 or more), as YAML text.

    Args:
        aircraft_folder: of the shipped aircraft, as seen from where the text will be written.
    """
    rng = random.Random(seed)
    aircraft, form = drawn(rng, AIRCRAFT), drawn(rng, FORMS)
    passing = drawn(rng, {"window": 0.50, "point": 0.25, "mixed": 0.25})
    style = Style(aircraft, form, passing, rng.randint(15, 40) if chance(rng, 0.8) else None)
    course = walked_course(rng, style)
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
    sys.stdout.write(generated_course(int(sys.argv[1])))
