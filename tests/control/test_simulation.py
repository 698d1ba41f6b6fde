"""Manoeuvres of the point mass flown by every model of the ladder."""

import dataclasses

import numpy as np
import pytest
from manoeuvres import LADDER, SCRIPTS, flown, ladder_model

from airrace.control.outer_loop import PathGains
from airrace.control.reference import Reference
from airrace.control.simulation import STEP, Followed, follow, pilot
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.runge_kutta import RK4
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.stage import Stage
from airrace.trajectory import Array

DEGREE = np.pi / 180.0
WINDY = Air(wind=StaticWind(0.9, 8.0, Profile.POWER), thermals=(Thermal(200.0, 20.0, 2.0, 1400.0),))
IN_WIND = [name for name in SCRIPTS if name != "vertical roll"]
"""A vertical roll at no load factor has nothing to hold against a crosswind that turns around the aircraft."""
STILL = Air()


def followed(
    stage: str, name: str, air: Air = STILL, *, intervals: int = 50, step: float = STEP, gains: PathGains | None = None
) -> Followed:
    """A manoeuvre flown by a model of the ladder."""
    reference = flown(name, air).reference
    nodes = np.linspace(0.0, reference.duration, intervals + 1)
    flying = pilot(ladder_model(stage, air), fidelity_of(Stage(stage)).controller(), gains=gains, step=step)
    return follow(flying, reference, nodes=nodes)


def row(stage: str, name: str) -> int:
    return [one.name for one in ladder_model(stage).system.states].index(name)


@pytest.mark.parametrize("name", SCRIPTS)
@pytest.mark.parametrize("stage", LADDER)
def test_manoeuvre_of_the_point_mass_is_followed(stage: str, name: str) -> None:
    flight = followed(stage, name)
    assert flight.finished
    assert flight.tracking_error < 3.0
    assert flight.end_distance < 1.0
    assert abs(flight.end_roll) < 8.0 * DEGREE


@pytest.mark.parametrize("name", IN_WIND)
@pytest.mark.parametrize("stage", LADDER)
def test_manoeuvre_is_followed_in_the_wind_that_the_reference_was_flown_in(stage: str, name: str) -> None:
    flight = followed(stage, name, WINDY)
    assert flight.finished
    assert flight.tracking_error < 3.0
    assert flight.end_distance < 1.0
    assert abs(flight.end_roll) < 8.0 * DEGREE


@pytest.mark.parametrize("stage", LADDER)
def test_flight_takes_about_as_long_as_the_reference(stage: str) -> None:
    for name in SCRIPTS:
        flight = followed(stage, name)
        assert flight.time[0] == 0.0
        assert flight.time[-1] == pytest.approx(flown(name).reference.duration, rel=0.02)
        assert flight.durations.sum() == pytest.approx(flight.time[-1])


@pytest.mark.parametrize("stage", LADDER)
def test_half_the_step_leads_to_the_same_flight(stage: str) -> None:
    for name in ("7 g slalom", "half Cuban eight"):
        whole, half = followed(stage, name), followed(stage, name, step=STEP / 2)
        assert np.linalg.norm(whole.state[:3] - half.state[:3], axis=0).max() < 0.05


def test_same_flight_twice_is_the_same() -> None:
    one, other = followed("six-dof", "barrel roll"), followed("six-dof", "barrel roll")
    assert np.array_equal(one.state, other.state)
    assert np.array_equal(one.control, other.control)


def mirrored(reference: Reference) -> Reference:
    """The reference seen in a mirror that exchanges east and west."""
    odd = ("y", "v_E", "a_E", "q1", "q3", "n_y", "p_Kbar", "soft_p", "soft_p_dot")
    histories = dataclasses.replace(reference.histories, **{name: -getattr(reference.histories, name) for name in odd})
    return dataclasses.replace(reference, histories=histories)


@pytest.mark.parametrize("stage", LADDER)
def test_mirrored_reference_is_followed_in_the_mirrored_way(stage: str) -> None:
    reference = flown("7 g slalom").reference
    nodes = np.linspace(0.0, reference.duration, 30)
    flying = pilot(ladder_model(stage), fidelity_of(Stage(stage)).controller())
    one, other = (follow(flying, each, nodes=nodes) for each in (reference, mirrored(reference)))
    signs = np.array([[1.0], [-1.0], [1.0]])
    assert signs * other.state[:3] == pytest.approx(one.state[:3], abs=1e-4)
    assert other.tracking_error == pytest.approx(one.tracking_error, abs=1e-4)


@pytest.mark.parametrize("stage", LADDER)
def test_controls_lead_from_node_to_node_within_their_bounds(stage: str) -> None:
    model = ladder_model(stage)
    flight = followed(stage, "half Cuban eight", intervals=240)
    steps = np.diff(flight.time)
    for value, declared in zip(flight.control, model.system.controls, strict=True):
        assert declared.lower <= value.min()
        assert value.max() <= declared.upper
    legs = zip(flight.state.T[:-1], flight.control.T, steps, strict=True)
    ends = np.column_stack([_integrated(stage, x, u, duration) for x, u, duration in legs])
    missed = ends - flight.state[:, 1:]
    assert np.linalg.norm(missed[:3], axis=0).max() < 0.05
    commanded = [index for index, one in enumerate(model.system.states) if one.name in ("eta", "xi", "zeta", "n_z_cmd")]
    assert np.abs(missed[commanded]).max() < 1e-6
    assert np.abs(missed[row(stage, "delta_T")]).max() < 0.02


def _integrated(stage: str, x: Array, u: Array, duration: float) -> Array:
    model, parts = ladder_model(stage), 5
    for _ in range(parts):
        x = np.asarray(RK4.advance(model.system.rates, x, u, model.parameter_values, duration / parts)).ravel()
    return x


@pytest.mark.parametrize("stage", LADDER)
def test_departure_is_a_value(stage: str) -> None:
    flight = followed(stage, "half Cuban eight", gains=PathGains(K_p=-30.0, K_v=-30.0, K_mu=-20.0))
    assert not flight.finished
    assert np.isnan(flight.time[-1])
    assert np.isnan(flight.state[:, -1]).all()
    assert flight.time[0] == 0.0
    assert np.isfinite(flight.state[:, 0]).all()


@pytest.mark.parametrize("stage", LADDER)
def test_rolls_are_counted_along(stage: str) -> None:
    model = ladder_model(stage, counting=True)
    reference = flown("barrel roll", counting=True).reference
    nodes = np.linspace(0.0, reference.duration, 40)
    flight = follow(pilot(model, fidelity_of(Stage(stage)).controller()), reference, nodes=nodes)
    histories = {one.name: values for one, values in zip(model.system.states, flight.state, strict=True)}
    assert histories["Phi"][-1] == pytest.approx(2.0 * np.pi, abs=0.1)
    assert histories["gain"] == pytest.approx(np.interp(nodes, reference.s, reference.histories.gain), abs=2.0)


def test_phases_are_those_of_the_reference() -> None:
    whole = flown("barrel roll").reference
    parts = dataclasses.replace(whole, boundaries=np.array([0.0, 1.0, 2.5, whole.duration]))
    nodes = np.linspace(0.0, whole.duration, 21)
    flying = pilot(ladder_model("six-dof"), fidelity_of(Stage.SIX_DOF).controller())
    flight = follow(flying, parts, nodes=nodes)
    times = np.interp(parts.boundaries, nodes, flight.time)
    assert flight.durations == pytest.approx(np.diff(times), abs=1e-3)
