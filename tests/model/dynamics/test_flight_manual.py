"""Figures of steady flight by closed forms and balances, and aircraft that have the figures of a flight manual."""

import dataclasses
import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from scipy.optimize import brentq

from airrace.errors import UsageError
from airrace.model.aircraft import Aircraft, aircraft_parameters
from airrace.model.dynamics.flight_manual import (
    ManualFigures,
    climb_rate,
    estimate,
    full_thrust,
    performance,
    roll_rate,
    stall_speed,
    sustained_load_factor,
    top_speed,
    under,
)
from airrace.model.dynamics.handling import faults
from airrace.model.environment import RHO_ISA, g0
from airrace.runs.aircraft_file import read_aircraft_file


def changed(aircraft: Aircraft, group: str, **values: Any) -> Aircraft:
    return dataclasses.replace(aircraft, **{group: dataclasses.replace(getattr(aircraft, group), **values)})


def drag(aircraft: Aircraft, V: float, load_factor: float) -> float:
    qS = 0.5 * RHO_ISA * V * V * aircraft.airframe.S
    C_L = load_factor * aircraft.airframe.m * g0 / qS
    return qS * (aircraft.drag.C_D0 + aircraft.drag.k * (C_L - aircraft.drag.C_L_minD) ** 2)


def test_the_wing_carries_the_weight_at_the_stall_at_its_largest_lift(edge540: Aircraft) -> None:
    lift = 0.5 * RHO_ISA * stall_speed(edge540) ** 2 * edge540.airframe.S * edge540.lift.C_L_max
    assert lift == pytest.approx(edge540.airframe.m * g0, rel=1e-12)


def test_thrust_balances_drag_at_the_top_speed_and_no_longer_beyond(edge540: Aircraft) -> None:
    V = top_speed(edge540)
    assert full_thrust(aircraft_parameters(edge540), V) == pytest.approx(drag(edge540, V, 1.0), rel=1e-9)
    assert all(
        full_thrust(aircraft_parameters(edge540), V + dV) < drag(edge540, V + dV, 1.0) for dV in (0.1, 1.0, 10.0, 100.0)
    )


def test_top_speed_without_induced_drag_is_that_of_the_closed_form(edge540: Aircraft) -> None:
    """Without a bound of the thrust and without induced drag `V^3 = 2 P/(rho S C_D0)`."""
    plain = changed(changed(edge540, "drag", k=1e-12), "propulsion", T_static=1e12)
    P = plain.propulsion.eta_p * plain.propulsion.P_max
    V = (2.0 * P / (RHO_ISA * plain.airframe.S * plain.drag.C_D0)) ** (1.0 / 3.0)
    assert top_speed(plain) == pytest.approx(V, rel=1e-6)


def test_an_aircraft_without_power_to_carry_itself_has_neither_top_speed_nor_turn(edge540: Aircraft) -> None:
    heavy = under(edge540, 20.0 * edge540.airframe.m, None)
    assert (top_speed(heavy), sustained_load_factor(heavy)) == (0.0, 0.0)
    assert climb_rate(heavy) < 0.0


def test_forces_balance_along_the_path_at_the_best_climb(edge540: Aircraft) -> None:
    """No speed climbs faster than by `m g0 sin gamma = T - D` with a lift of `m g0 cos gamma`."""
    weight, numbers = edge540.airframe.m * g0, aircraft_parameters(edge540)

    def climb(V: float) -> float:
        def excess(sine: float) -> float:
            return full_thrust(numbers, V) - drag(edge540, V, math.sqrt(1.0 - sine * sine)) - weight * sine

        return V * brentq(excess, -1.0, 1.0)

    best = max(climb(30.0 + 0.1 * step) for step in range(400))
    assert climb_rate(edge540) == pytest.approx(best, rel=1e-6)


@pytest.mark.parametrize("mass", [600.0, 698.0, 900.0])
def test_lighter_and_stronger_aircraft_climb_and_turn_better(edge540: Aircraft, mass: float) -> None:
    one = under(edge540, mass, None)
    lighter, stronger = under(edge540, 0.95 * mass, None), under(one, None, 1.05 * one.propulsion.P_max)
    for better in (lighter, stronger):
        assert climb_rate(better) > climb_rate(one)
        assert top_speed(better) > top_speed(one)
        assert sustained_load_factor(better) > sustained_load_factor(one)


@pytest.mark.parametrize("C_L_minD", [0.0, 0.2])  # with 0.2 drag is least above 1 g where the aircraft is fast
def test_the_tightest_turn_is_held_by_the_thrust_and_no_speed_holds_a_tighter_one(
    edge540: Aircraft, C_L_minD: float
) -> None:
    aircraft = changed(edge540, "drag", C_L_minD=C_L_minD)
    n = sustained_load_factor(aircraft)
    excess = [
        full_thrust(aircraft_parameters(aircraft), V) - drag(aircraft, V, n)
        for V in (30.0 + 0.05 * step for step in range(2000))
    ]
    assert max(excess) == pytest.approx(0.0, abs=0.1)


def test_damping_balances_the_ailerons_at_the_roll_rate(edge540: Aircraft) -> None:
    V, roll = 92.6, edge540.roll
    p = roll_rate(edge540, V)
    moment = roll.C_lxi * edge540.surfaces.xi.lower + roll.C_lp * p * edge540.airframe.b / (2.0 * V)
    assert moment == pytest.approx(0.0, abs=1e-12)
    assert roll_rate(edge540, 2.0 * V) == pytest.approx(2.0 * p, rel=1e-12)


def test_the_wing_reaches_the_largest_load_factor_at_V_A(edge540: Aircraft) -> None:
    found = performance(edge540)
    assert found.speed_max > found.V_A
    assert (found.V_A / found.stall) ** 2 == pytest.approx(edge540.envelope.n_z.upper, rel=1e-12)
    assert found.roll_rate == roll_rate(edge540, found.V_A)
    assert math.isclose(performance(edge540, 50.0).roll_rate, roll_rate(edge540, 50.0))


CONFIGS = Path(__file__).parents[3] / "configs"
TEMPLATES = [read_aircraft_file(CONFIGS / f"{name}.yaml").aircraft for name in ("edge540", "pc9")]
EDGE = TEMPLATES[0]
KNOT = 1852.0 / 3600.0


def figures_of(aircraft: Aircraft) -> ManualFigures:
    """What a flight manual would say of an aircraft."""
    found, airframe, envelope = performance(aircraft), aircraft.airframe, aircraft.envelope
    return ManualFigures(
        mass=airframe.m,
        span=airframe.b,
        area=airframe.S,
        power=aircraft.propulsion.P_max,
        stall=found.stall,
        speed_max=found.speed_max,
        climb=found.climb,
        roll_rate=aircraft.point_mass.p,
        roll_speed=found.V_A * aircraft.point_mass.p / found.roll_rate,
        n_z=envelope.n_z.upper,
        n_z_min=envelope.n_z.lower,
        speed_limit=envelope.V.upper,
    )


def numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:  # Any: records of any kind
    if isinstance(value, float):
        yield name, value
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from numbers(getattr(value, field.name), f"{name}.{field.name}")


def estimated(**figures: float) -> Aircraft:
    return estimate(EDGE, ManualFigures(**figures), "mine")[0]


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda one: one.name)
def test_the_figures_of_a_template_make_the_template(template: Aircraft) -> None:
    again = dict(numbers(estimate(template, figures_of(template), "again")[0]))
    for name, value in numbers(template):
        assert again[name] == pytest.approx(value, rel=1e-5, abs=1e-12), name


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda one: one.name)
def test_either_template_has_the_figures_of_the_other_and_flies(template: Aircraft) -> None:
    (other,) = (one for one in TEMPLATES if one is not template)
    figures = figures_of(other)
    mine, _ = estimate(template, figures, "mine")
    found = performance(mine)
    assert (found.stall, found.speed_max) == pytest.approx((figures.stall, figures.speed_max), rel=1e-6)
    assert found.climb == pytest.approx(figures.climb, rel=1e-6)
    assert roll_rate(mine, figures.roll_speed or 0.0) == pytest.approx(figures.roll_rate, rel=1e-6)
    assert faults(mine) == ()


def test_figures_hold_at_the_mass_and_power_of_the_manual() -> None:
    mine = estimated(mass=698.0, stall=30.0, climb=17.0, manual_mass=816.0, manual_power=250e3, speed_max=115.0)
    manual = under(mine, 816.0, 250e3)
    found = (stall_speed(manual), climb_rate(manual), top_speed(manual))
    assert found == pytest.approx((30.0, 17.0, 115.0), rel=1e-6)
    assert mine.airframe.m == 698.0
    assert mine.propulsion.P_max == EDGE.propulsion.P_max


MONOTONE = (
    ("stall", (27.0, 29.0, 31.0), lambda one: -one.lift.C_L_max),
    ("speed_max", (105.0, 112.0, 119.0), lambda one: -one.drag.C_D0),
    ("climb", (15.0, 18.0, 20.0), lambda one: one.propulsion.eta_p),
    ("roll_rate", (5.0, 6.0, 7.0), lambda one: -one.roll.C_lxi),
    ("power", (180e3, 220e3, 260e3), lambda one: one.propulsion.T_static),
    ("mass", (600.0, 700.0, 800.0), lambda one: one.airframe.I_x),
    ("span", (7.0, 7.5, 8.0), lambda one: one.lift.C_Lalpha),
    ("area", (8.5, 9.0, 9.5), lambda one: one.drag.k),
    ("n_z", (8.0, 10.0, 12.0), lambda one: -one.envelope.n_z.lower),
)


@pytest.mark.parametrize(("figure", "values", "number"), MONOTONE, ids=[name for name, _, _ in MONOTONE])
def test_what_is_larger_in_the_manual_is_larger_in_the_aircraft(figure: str, values: Any, number: Any) -> None:
    found = [number(estimated(**{figure: value})) for value in values]
    assert all(before < after for before, after in itertools.pairwise(found))


def test_a_larger_aircraft_of_the_same_shape_has_the_same_coefficients() -> None:
    s = 1.3
    airframe = EDGE.airframe
    larger = estimated(mass=s**3 * airframe.m, span=s * airframe.b, area=s**2 * airframe.S)
    assert larger.airframe.cbar == pytest.approx(s * airframe.cbar, rel=1e-12)
    assert larger.airframe.I_y == pytest.approx(s**5 * airframe.I_y, rel=1e-12)
    for group in ("lift", "drag", "side_force", "roll", "pitch", "yaw"):
        same = dict(numbers(getattr(EDGE, group)))
        assert dict(numbers(getattr(larger, group))) == pytest.approx(same, rel=1e-12), group


def test_nothing_changes_without_a_reason() -> None:
    """Of the numbers that differ from the template's, each has its relation; of those without, none differs."""
    mine, relations = estimate(EDGE, ManualFigures(span=7.9, stall=29.0, speed_max=112.0, roll_rate=6.5), "mine")
    before = dict(numbers(EDGE))
    differ = {name for name, value in numbers(mine) if value != before[name] and not name.startswith(".envelope")}
    assert differ == {f".{group}.{field}" for group, field in relations if group != "envelope"}


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({"stall": 14.0}, r"a stall at 14 m/s \(--stall\) with 698 kg .* takes a C_L_max of 6.27; .*--manual-mass"),
        ({"stall": 60.0}, r"C_L_max of 0\.341"),
        ({"speed_max": 25.0}, r"--speed-max 25 m/s is below the stall"),
        ({"speed_max": 200.0}, r"a top speed of 200 m/s \(--speed-max\) .* takes a C_D0 of 0.00"),
        (
            {"climb": 40.0, "speed_max": 114.0},
            r"and 114 m/s top speed no propeller makes a climb \(--climb\) in m/s of 40; .* to 21.8",
        ),
        ({"span": 2.5}, r"an aspect ratio of 0\.687; aircraft have 2 to 30"),
        (
            {"roll_rate": 17.0, "roll_speed": 15.0},
            r"974 deg/s \(--roll-rate\) at 15.0 m/s take a helix angle .* of 4\.21",
        ),
        ({"mass": 4000.0, "power": 30e3}, r"30 kW \(--power\) carry 4000 kg \(--mass\) in level flight at no speed"),
        ({"speed_max": 110.0, "speed_limit": 90.0}, r"--speed-limit 90 m/s is below --speed-max 110 m/s"),
    ],
)
def test_figures_that_no_aircraft_has_are_refused_in_one_sentence(figures: dict[str, float], words: str) -> None:
    with pytest.raises(UsageError) as refused:
        estimated(**figures)
    assert re.search(words, str(refused.value)), str(refused.value)
    assert "\n" not in str(refused.value)
