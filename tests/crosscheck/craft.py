"""The shipped aircraft, and one that leaves no coefficient out, for the tests against JSBSim."""

import dataclasses
from pathlib import Path

from airrace.dynamics.inner_loop_parameters import InnerLoopParameters, inner_loop_parameters
from airrace.environment.air import Air
from airrace.environment.atmosphere import atmosphere_parameters
from airrace.inputs import load_inputs

ROOT = Path(__file__).parents[2]
STANDARD = atmosphere_parameters(Air())
HOT_AND_HIGH = atmosphere_parameters(Air(temperature_offset=18.0, pressure_offset=-900.0, elevation=420.0))


def shipped(name: str) -> InnerLoopParameters[float]:
    track = ROOT / "tracks/half_cuban_eight.yaml"
    return inner_loop_parameters(load_inputs(track, aircraft=ROOT / "configs" / f"{name}.yaml").race.aircraft)


EDGE, PC9 = shipped("edge540"), shipped("pc9")


def complete() -> InnerLoopParameters[float]:
    """The PC-9 with a propeller that turns it, and something in place of every coefficient that is zero."""
    zeros = {name: 0.04 for name, value in vars(PC9).items() if value == 0.0}
    return dataclasses.replace(PC9, **zeros | {"h_P": 1500.0, "Q_P": 700.0})


COMPLETE = complete()
