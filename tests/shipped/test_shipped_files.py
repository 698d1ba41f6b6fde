"""Shipped aircraft and courses."""

import dataclasses
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.files.inputs import load_inputs
from airrace.model.aircraft import Aircraft
from airrace.model.environment import RHO_ISA, g0
from airrace.model.track.course import Course, Direction, Turning
from airrace.model.track.gates import Gate, Manoeuvre, Passing, Pylon
from airrace.model.track.polygons import Point, to_right
from airrace.procedure.planning.plan import plan
from airrace.procedure.planning.planning_model import cruise
from airrace.race import Race

ROOT = Path(__file__).parents[2]
KNOT = 1852.0 / 3600.0
KMH = 1.0 / 3.6


def aircraft(name: str) -> Aircraft:
    return load_inputs(ROOT / "tracks/rovinj_2014.yaml", aircraft=ROOT / "configs" / f"{name}.yaml").race.aircraft


PC9 = aircraft("pc9")
EDGE = aircraft("edge540")


def stall_speed(flown: Aircraft, m: float) -> float:
    """Least speed of level flight at sea level with the mass `m`, m/s."""
    return math.sqrt(2.0 * m * g0 / (RHO_ISA * flown.airframe.S * flown.lift.C_L_max))


def top_speed(flown: Aircraft) -> float:
    """Speed at which full thrust balances the drag of level flight at sea level, m/s."""
    slow, fast = 60.0, 200.0
    while fast - slow > 1e-6:
        V = 0.5 * (slow + fast)
        slow, fast = (V, fast) if excess_thrust(flown, V) > 0.0 else (slow, V)
    return slow


def excess_thrust(flown: Aircraft, V: float) -> float:
    engine, drag, airframe = flown.propulsion, flown.drag, flown.airframe
    power = engine.eta_p * engine.P_max
    qS = 0.5 * RHO_ISA * V**2 * airframe.S
    C_L = airframe.m * g0 / qS
    return power / math.hypot(V, power / engine.T_static) - qS * (drag.C_D0 + drag.k * (C_L - drag.C_L_minD) ** 2)


def full_aileron_roll_rate(flown: Aircraft, V: float) -> float:
    """Steady roll rate at which damping balances the ailerons, rad/s."""
    return flown.roll.C_lxi / flown.roll.C_lp * flown.surfaces.xi.upper * 2.0 * V / flown.airframe.b


def test_pc9_is_as_fast_at_sea_level_as_published() -> None:
    assert top_speed(PC9) == pytest.approx(496 * KMH, rel=0.02)


def test_pc9_stalls_where_the_type_does() -> None:
    assert stall_speed(PC9, 2250.0) == pytest.approx(79 * KNOT, rel=0.01)


def test_pc9_reaches_its_load_factor_limit_near_200_knots() -> None:
    V = stall_speed(PC9, PC9.airframe.m) * math.sqrt(PC9.envelope.n_z.upper)
    assert pytest.approx(200 * KNOT, rel=0.02) == V


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_speed_limits_lie_above_the_stall_and_the_top_speed(flown: Aircraft) -> None:
    assert flown.envelope.V.lower == pytest.approx(1.2 * stall_speed(flown, flown.airframe.m), rel=0.03)
    assert flown.envelope.V.upper > 1.05 * top_speed(flown)


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_the_point_mass_rolls_about_as_fast_as_full_ailerons_make_it(flown: Aircraft) -> None:
    assert flown.point_mass.p == pytest.approx(full_aileron_roll_rate(flown, 180 * KNOT), rel=0.15)


@pytest.mark.parametrize("flown", [PC9, EDGE], ids=lambda flown: flown.name)
def test_the_sideslip_limit_binds_before_the_lateral_load_factor_does(flown: Aircraft) -> None:
    """The rudder that holds the sideslip takes part of its side force away."""
    beta, V = flown.drag.beta_A_max, flown.envelope.V.upper
    zeta = -flown.yaw.C_nbeta * beta / flown.yaw.C_nzeta
    C_Y = flown.side_force.C_Ybeta * beta + flown.side_force.C_Yzeta * zeta
    n_y = 0.5 * RHO_ISA * V**2 * flown.airframe.S * abs(C_Y) / (flown.airframe.m * g0)
    assert n_y < flown.point_mass.n_y


AIRCRAFT = ("corvus540", "edge540", "extra330lx", "extra330sc", "mxs_r", "pc9", "zlin50")
TRACKS = sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml"))
FROM_AXES = ("abu_dhabi_2016", "chiba_2015", "gdynia_2014", "rovinj_2014", "san_diego_2017")
"""Courses whose source gives no direction, but an axis per gate."""
FOOT = 0.3048
SECONDS = 0.1
"""A route that is no longer than this than the shortest one is as short."""


def track(name: str) -> Path:
    return ROOT / "tracks" / f"{name}.yaml"


def race(name: str) -> Race:
    return load_inputs(track(name)).race


def planned_seconds(race: Race, course: Course) -> float:
    return plan(course, cruise(race.aircraft, course.rules)).seconds


def undirected(course: Course, *, but: tuple[str, ...] = ()) -> Course:
    """The course with the directions of all its gates left to the plan, and nothing beside it."""
    passages = [dataclasses.replace(passage, safety_lines=()) for passage in course.passages]
    freed = [
        dataclasses.replace(passage, direction=Direction.PLANNED)
        if isinstance(passage.element, Gate) and passage.element.name not in but
        else passage
        for passage in passages
    ]
    return dataclasses.replace(course, passages=tuple(freed))


def names(course: Course) -> list[str]:
    return [passage.name for passage in course.passages]


# All of them


@pytest.mark.parametrize("aircraft", AIRCRAFT)
@pytest.mark.parametrize("name", TRACKS)
def test_every_course_can_be_flown_by_either_aircraft(name: str, aircraft: str) -> None:
    inputs = load_inputs(track(name), aircraft=ROOT / "configs" / f"{aircraft}.yaml")
    assert len(inputs.race.course.passages) > 4


@pytest.mark.parametrize("name", TRACKS)
def test_every_course_passes_the_check(name: str) -> None:
    ran = CliRunner().invoke(app, ["check", str(track(name))])
    assert ran.exit_code == 0, ran.stderr
    assert race(name).course.name in ran.stdout


@pytest.mark.parametrize("name", TRACKS)
def test_no_course_leaves_a_direction_to_the_plan(name: str) -> None:
    assert all(passage.direction is not Direction.PLANNED for passage in race(name).course.passages)


# Real courses


@pytest.mark.parametrize("name", FROM_AXES)
def test_the_directions_written_are_the_shortest_way_round(name: str) -> None:
    """But for gate 4 of Abu Dhabi, whose direction is known from elsewhere."""
    flown = race(name)
    but = ("g4",) if name == "abu_dhabi_2016" else ()
    written = dataclasses.replace(
        flown.course, passages=tuple(dataclasses.replace(one, safety_lines=()) for one in flown.course.passages)
    )
    shortest = undirected(flown.course, but=but)
    assert planned_seconds(flown, written) <= planned_seconds(flown, shortest) + SECONDS


@pytest.mark.parametrize("name", FROM_AXES)
def test_real_courses_are_flown_through_windows_past_pylons_with_their_margin(name: str) -> None:
    elements = {passage.element.name: passage.element for passage in race(name).course.passages}
    for element in elements.values():
        assert isinstance(element, Gate | Pylon)
        assert element.passing is Passing.WINDOW
        if isinstance(element, Pylon):
            assert (element.tolerances.clearance, element.reach) == (3.5, 100.0)
        else:
            assert element.width == 13.0


@pytest.mark.parametrize(
    ("name", "out", "back"), [("chiba_2015", (1, 2, 3), (10, 9, 8)), ("gdynia_2014", (1, 2, 3), (8, 7, 6))]
)
def test_slaloms_flown_both_ways_change_their_sides(name: str, out: tuple[int, ...], back: tuple[int, ...]) -> None:
    elements = {passage.element.name: passage.element for passage in race(name).course.passages}
    for there, home in zip(out, back, strict=True):
        a, b = elements[f"g{there}"], elements[f"g{home}"]
        assert isinstance(a, Pylon)
        assert isinstance(b, Pylon)
        assert (a.north, a.east) == (b.north, b.east)
        assert math.cos(a.side - b.side) == pytest.approx(-1.0)


def test_the_safety_line_of_abu_dhabi_holds_between_gates_4_and_5_alone() -> None:
    course = race("abu_dhabi_2016").course
    lines = {passage.name: [line.name for line in passage.safety_lines] for passage in course.passages}
    assert {name: held for name, held in lines.items() if held} == {"1:g5": ["shore"], "2:g5": ["shore"]}


def test_gates_4_and_5_of_abu_dhabi_lie_on_the_allowed_side_of_the_line() -> None:
    """30 to 50 m away, as well as the two sources agree, whose positions scatter by 5.5 m."""
    scatter = 5.5
    passages = {passage.element.name: passage for passage in race("abu_dhabi_2016").course.passages}
    (line,) = passages["g5"].safety_lines
    assert not line.keep_right
    for name in ("g4", "g5"):
        gate = passages[name].element
        assert isinstance(gate, Gate)
        to_left = -to_right(line.start, line.end, Point(gate.north, gate.east))
        assert 30.0 - scatter < to_left - line.margin < 50.0 + scatter, name


# Air Race X


def test_air_race_x_goes_up_and_down_twice_and_ends_at_its_start() -> None:
    course = race("air_race_x_2024").course
    assert [name.split("#")[0] for name in names(course)] == [
        "0:A",
        *("1:B", "1:C", "1:D", "1:E", "1:B", "1:A"),
        *("2:top", "2:C", "2:D", "2:E", "2:roll/begin", "2:roll"),
        "2:A",
    ]


def test_the_chicane_of_air_race_x_is_passed_at_alternating_sides() -> None:
    pylons = [passage.element for passage in race("air_race_x_2024").course.passages[:5]]
    assert [round(math.degrees(one.side)) for one in pylons if isinstance(one, Pylon)] == [90, 270, 90, 270, 90]
    assert [one.north for one in pylons if isinstance(one, Pylon)] == [0.0, 200.0, 400.0, 600.0, 800.0]


def test_the_big_turns_of_air_race_x_reach_500_and_700_feet() -> None:
    passages = {passage.name: passage for passage in race("air_race_x_2024").course.passages}
    top, roll = passages["2:top"].element, passages["2:roll"]
    assert isinstance(top, Manoeuvre)
    assert isinstance(roll.element, Manoeuvre)
    assert top.height.lower == pytest.approx(500 * FOOT)
    assert roll.element.height.lower == pytest.approx(700 * FOOT, abs=0.05)
    assert roll.roll is not None
    assert roll.roll.angle == pytest.approx(math.radians(315))
    assert roll.roll.turning is Turning.EITHER
