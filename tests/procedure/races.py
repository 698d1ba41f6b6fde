"""Races for the tests of the procedure: the shipped ones and a small one."""

import dataclasses
import functools
import math
from pathlib import Path

from kept import kept

from airrace.environment.air import Air, StaticWind
from airrace.inputs import load_inputs
from airrace.planning.plan import Plan, plan
from airrace.planning.planning_model import cruise
from airrace.planning.race import Race
from airrace.procedure.progress import Silent
from airrace.procedure.result import Stage, StageResult
from airrace.procedure.run import optimize
from airrace.procedure.settings import GuessKind, MeshCheck, SearchEffort, Settings
from airrace.procedure.stage_problem import Flight, stage_flight
from airrace.quantities import Interval
from airrace.track.course import Course, Passage, Rules
from airrace.track.gates import Element, Gate, Passing, Pylon, Tolerances

ROOT = Path(__file__).parents[2]
COURSES = ("half_cuban_eight", "rovinj_2014", "sixteen_phases")
SHIPPED = {name: load_inputs(ROOT / "tracks" / f"{name}.yaml").race for name in COURSES}
SIXTEEN = SHIPPED["sixteen_phases"]
EDGE_540 = SHIPPED["rovinj_2014"].aircraft
DEGREE = math.pi / 180.0
KNOT = 1852.0 / 3600.0
RULES = Rules(n_z=Interval(-2.0, 10.0), height=Interval(lower=10.0))
WINDOW = Tolerances(
    clearance=0.5,
    height=Interval(15.0, 25.0),
    bank=10 * DEGREE,
    climb=Interval(-45 * DEGREE, 45 * DEGREE),
    crossing=60 * DEGREE,
)
BESIDE = dataclasses.replace(WINDOW, clearance=3.5, bank=math.pi)


def level(name: str, north: float, east: float, heading: float, passing: Passing = Passing.WINDOW) -> Gate:
    """A level gate 13 m wide; `heading` in degrees."""
    return Gate(name, north, east, 20.0, heading * DEGREE, 13.0, passing, WINDOW)


def knife_edge(name: str, north: float, east: float, heading: float, *, right: bool, either: bool = False) -> Gate:
    """A gate to be flown exactly, on the right or the left wing; `heading` in degrees."""
    bank = math.pi / 2 if right else -math.pi / 2
    return Gate(name, north, east, 20.0, heading * DEGREE, 13.0, Passing.POINT, WINDOW, bank, either)


def pylon(name: str, north: float, east: float, side: float) -> Pylon:
    """A single pylon; `side` in degrees."""
    return Pylon(name, north, east, 20.0, side * DEGREE, 100.0, Passing.WINDOW, BESIDE)


def course(name: str, *elements: Element, rules: Rules = RULES) -> Course:
    """The elements in order, started at 200 knots at most."""
    passages = [Passage(element.name, 1, element) for element in elements]
    passages[0] = dataclasses.replace(passages[0], speed=Interval(upper=200 * KNOT))
    return Course(name, tuple(passages), rules)


SMALL = Race(
    course(
        "four gates",
        level("first", 0.0, 0.0, 20.0),
        pylon("pylon", 300.0, 60.0, 110.0),
        knife_edge("edge", 480.0, -120.0, 270.0, right=False),
        level("last", 250.0, -300.0, 170.0),
    ),
    EDGE_540,
    Air(),
)

RACES = {**SHIPPED, "four_gates": SMALL}


def one_lap(race: Race) -> Race:
    """The sixteen phases without the second of their two laps."""
    return dataclasses.replace(race, course=dataclasses.replace(race.course, passages=race.course.passages[:9]))


def blown(race: Race, origin: float, speed: float) -> Race:
    """The race in a constant wind from `origin` (degrees) with `speed` (m/s)."""
    air = dataclasses.replace(race.air, wind=StaticWind(origin * DEGREE, speed) if speed else None)
    return dataclasses.replace(race, air=air)


@functools.cache
def planned(race: Race) -> Plan:
    """The plan of a race."""
    return plan(race.course, cruise(race.aircraft, race.course.rules))


def prepared(race: Race, stage: Stage = Stage.POINT_MASS) -> Flight:
    """A race made ready for optimisation with the default settings."""
    return stage_flight(stage, race, Settings())


def settings(guess: GuessKind, *, search: SearchEffort = SearchEffort.OFF) -> Settings:
    """Default settings but for the guess, all stages are proved.

    Other routes are explored where that is asked for.
    """
    silent = Settings(mesh_check=MeshCheck.ALL)
    return dataclasses.replace(silent, guess=guess, search=search)


@kept
def flown(race: Race, chosen: Settings) -> tuple[StageResult, ...]:
    """All stages of a race; flown once however many tests ask."""
    return tuple(optimize(race, chosen, until=Stage.POINT_MASS, threads=1, progress=Silent()))


def optimum(race: Race, chosen: Settings) -> StageResult:
    """The point-mass stage, which must have been reached."""
    result = flown(race, chosen)[-1]
    assert result.stage is Stage.POINT_MASS
    return result
