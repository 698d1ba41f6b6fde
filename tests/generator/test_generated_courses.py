"""Courses drawn by lot are valid, the same everywhere, and cover what their table promises."""

import functools
import hashlib
import itertools
import math
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from generated_courses import generated_course

from airrace.inputs import Document, inputs_from_documents, load_inputs
from airrace.planning.race import Race
from airrace.track.course import Direction, Passage
from airrace.track.gates import Gate, Manoeuvre, Passing, Pylon

ROOT = Path(__file__).parents[2]
SEEDS = range(500)
GOLDEN = "12597b76becfa876ddf13cab1ff1ca0b8a2f504f3a4bdf9e443a614e16272071"
AIRCRAFT = {
    name: Document(f"{name}.yaml", (ROOT / f"configs/{name}.yaml").read_text(encoding="utf-8"))
    for name in ("edge540", "pc9")
}


@functools.cache
def race(seed: int) -> Race:
    """A course as understood; raises if anything is wrong with it."""
    text = generated_course(seed)
    (aircraft,) = re.findall(r'^aircraft: "\.\./configs/(\w+)\.yaml"$', text, re.MULTILINE)
    return inputs_from_documents(Document(f"{seed}.yaml", text), AIRCRAFT[aircraft], None, ()).race


def legs(seed: int) -> list[tuple[Passage, Passage]]:
    """Neighbouring passages that both have a place, whatever is performed between them."""
    placed = [passage for passage in race(seed).course.passages if not isinstance(passage.element, Manoeuvre)]
    return list(itertools.pairwise(placed))


def is_quad(before: Passage, after: Passage) -> bool:
    """Whether two passages are the two of one quad."""
    return before.name.split("/")[0] == after.name.split("/")[0]


def distance(before: Passage, after: Passage) -> float:
    a, b = before.element, after.element
    assert isinstance(a, Gate | Pylon)
    assert isinstance(b, Gate | Pylon)
    return math.hypot(b.north - a.north, b.east - a.east)


def turns(seed: int) -> list[float]:
    """Changes of direction from a gate to the next one where that is flown for the first time, deg.

    The axes give the change up to half turns; twice the angle from the first axis to the way across, which is drawn
    within 15 degrees of half the change, tells which.
    """
    found: list[float] = []
    flown: set[str] = set()
    for before, after in legs(seed):
        a, b = before.element, after.element
        flown.add(a.name)
        if not isinstance(a, Gate) or not isinstance(b, Gate) or b.name in flown or is_quad(before, after):
            continue
        if before.direction is not Direction.PLANNED:
            course = a.heading + (math.pi if before.direction is Direction.REVERSE else 0.0)
            bearing = math.atan2(b.east - a.east, b.north - a.north)
            guess = 2.0 * math.remainder(bearing - course, math.tau)
            found.append(math.degrees(guess + math.remainder(b.heading - course - guess, math.pi)))
    return found


def flown_in_a_lap(seed: int) -> int:
    passages = race(seed).course.passages
    return sum(passage.lap == 1 for passage in passages[1:])


def share(holds: list[bool]) -> float:
    return sum(holds) / len(holds)


# Valid and reproducible


@pytest.mark.parametrize("first", range(0, 500, 50))
def test_every_seed_gives_a_valid_course(first: int) -> None:
    for seed in range(first, first + 50):
        assert len(race(seed).course.passages) >= 5


def test_a_seed_gives_the_same_course_everywhere() -> None:
    texts = "".join(generated_course(seed) for seed in range(10))
    assert hashlib.sha256(texts.encode()).hexdigest() == GOLDEN


def test_seeds_give_different_courses() -> None:
    courses = {generated_course(seed).split("\n", 2)[2] for seed in SEEDS}
    assert len(courses) == len(SEEDS)


def test_the_text_names_its_aircraft_in_the_folder_asked_for(tmp_path: Path) -> None:
    track = tmp_path / "track.yaml"
    track.write_text(generated_course(3, (ROOT / "configs").as_posix()), encoding="utf-8")
    assert load_inputs(track).race == race(3)


def test_the_module_prints_the_course() -> None:
    command = [sys.executable, str(ROOT / "tests" / "generated_courses.py"), "7"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == generated_course(7)


# What no course may be


def test_neighbours_stand_120_to_600_m_apart_but_for_quads() -> None:
    """Slalom pylons may stand up to 10 m beside the row along which their distances are drawn."""
    for seed in SEEDS:
        for before, after in legs(seed):
            if is_quad(before, after):
                assert distance(before, after) == 0.0
            else:
                assert 110.0 < distance(before, after) < 610.0, (seed, before.name, after.name)


def test_slalom_pylons_are_passed_at_alternating_sides() -> None:
    """Up to five in a row are one slalom; more may be two."""
    slaloms = 0
    for seed in SEEDS:
        passages = race(seed).course.passages
        for is_slalom, group in itertools.groupby(passages, lambda one: one.element.name.startswith("slalom")):
            row = [one.element for one in group]
            if is_slalom and len(row) <= 5:
                slaloms += 1
                for a, b in itertools.pairwise(row):
                    assert isinstance(a, Pylon)
                    assert isinstance(b, Pylon)
                    assert math.cos(a.side - b.side) < -0.9, (seed, a.name)
    assert slaloms > 100


# What is reached over all seeds


def test_laps_have_4_to_24_passings() -> None:
    counts = Counter(flown_in_a_lap(seed) for seed in SEEDS)
    assert set(counts) == set(range(4, 25))


def test_one_and_two_laps_are_flown() -> None:
    laps = Counter(race(seed).course.passages[-1].lap for seed in SEEDS)
    assert set(laps) == {1, 2}
    assert min(laps.values()) > 150


def test_spacing_covers_its_range() -> None:
    spacings = [distance(*leg) for seed in SEEDS for leg in legs(seed) if not is_quad(*leg)]
    for lower in range(120, 600, 60):
        assert share([lower <= spacing < lower + 60 for spacing in spacings]) > 0.04, lower


def test_most_turns_are_below_90_degrees_many_below_180_and_some_up_to_270() -> None:
    drawn = [turn for seed in SEEDS for turn in turns(seed)]
    assert 0.58 < share([abs(turn) < 90.0 for turn in drawn]) < 0.72
    assert 0.20 < share([90.0 <= abs(turn) < 180.0 for turn in drawn]) < 0.30
    assert 0.07 < share([abs(turn) >= 180.0 for turn in drawn]) < 0.15
    assert 265.0 < max(drawn) < 272.0  # headings are written in whole degrees
    assert -272.0 < min(drawn) < -265.0
    assert 0.45 < share([turn > 0.0 for turn in drawn]) < 0.55


def test_all_kinds_of_elements_stand_on_the_courses() -> None:
    passages = [passage for seed in SEEDS for passage in race(seed).course.passages]
    elements = [passage.element for passage in passages]
    gates = [element for element in elements if isinstance(element, Gate)]
    banks = Counter((round(math.degrees(gate.bank)), gate.either_bank) for gate in gates)
    assert set(banks) == {(0, False), (90, False), (-90, False), (90, True)}
    assert {passage.direction for passage in passages if isinstance(passage.element, Gate)} == set(Direction)
    assert {element.passing for element in elements if isinstance(element, Gate | Pylon)} == set(Passing)
    assert {element.kind for element in elements if isinstance(element, Manoeuvre)} == {"high-turn"}
    heights = {element.height for element in elements if isinstance(element, Gate | Pylon)}
    assert heights == set(range(15, 41))
    with_quads = [any("/" in passage.name for passage in race(seed).course.passages) for seed in SEEDS]
    with_slaloms = [any("slalom" in passage.name for passage in race(seed).course.passages) for seed in SEEDS]
    assert share(with_quads) > 0.2
    assert share(with_slaloms) > 0.4


def test_some_gates_are_flown_both_ways() -> None:
    def both_ways(seed: int) -> bool:
        flown = {(one.element.name, one.direction) for one in race(seed).course.passages}
        names = Counter(name for name, direction in flown if direction is not Direction.PLANNED)
        return max(names.values()) > 1

    assert share([both_ways(seed) for seed in SEEDS]) > 0.3


def test_circuits_come_home_open_courses_do_not() -> None:
    def closed(seed: int) -> bool:
        first, *_, last = race(seed).course.passages
        return first.element == last.element

    assert 0.75 < share([closed(seed) for seed in SEEDS]) < 0.85


def test_rules_aircraft_and_air_cover_their_ranges() -> None:
    races = [race(seed) for seed in SEEDS]
    assert {one.course.rules.n_z.upper for one in races} == {half / 2.0 for half in range(16, 25)}
    assert 0.4 < share([one.course.passages[0].speed.bounded for one in races]) < 0.6
    assert 0.25 < share([one.aircraft.name == "PC-9 class" for one in races]) < 0.45
    winds = [one.air.wind for one in races]
    blowing = [wind for wind in winds if wind is not None]
    assert 0.1 < share([wind is None for wind in winds]) < 0.3
    assert {wind.profile.value for wind in blowing} == {"constant", "power", "log"}
    assert max(wind.speed for wind in blowing) > 14.5
    for quadrant in range(4):
        assert share([int(wind.origin / (math.pi / 2)) == quadrant for wind in blowing]) > 0.15


def test_some_courses_have_a_safety_line_and_some_a_crowd() -> None:
    passages = [race(seed).course.passages for seed in SEEDS]
    with_line = [any(passage.safety_lines for passage in one) for one in passages]
    assert 0.08 < share(with_line) < 0.2
    sides = {line.keep_right for one in passages for passage in one for line in passage.safety_lines}
    assert sides == {True, False}
    crowds = [crowd for seed in SEEDS for crowd in race(seed).course.crowd]
    assert 0.18 < len(crowds) / len(SEEDS) < 0.32
    assert {crowd.slant for crowd in crowds} == {True, False}
    assert min(crowd.distance for crowd in crowds) < 60.0
    assert max(crowd.distance for crowd in crowds) > 140.0
