"""The Half Cuban Eight of the paper's figure 4 as the default command flies it, in still air and in a crosswind."""

import math
from pathlib import Path

import numpy as np
import pytest
from airrace_command import inside

import airrace
from airrace.model.frames import rotation
from airrace.runs.stage_view import StageView

KNOT_20_FROM_WEST = ("--set", "environment.wind.speed_kt=20", "--set", "environment.wind.from_deg=270")
FIDELITIES = ["point-mass", "transfer-function", "state-space-inversion", "state-space", "six-dof"]
ENTRY_HEIGHT = 80.0
POINT_MASS_OFF_PLANE, OFF_PLANE = 1.0, 3.0
"""The largest deviation from the vertical plane through the entry, m: at the point mass, and with an inner loop."""


def solved_stages(folder: Path, *options: str) -> list[StageView]:
    """The stages of the course that comes along, as the command flies it."""
    ran = inside("optimize", "half_cuban_eight", "--output", "eight.h5", "--quiet", *options, cwd=folder)
    assert ran.code == 0, ran.err
    return [stage for stage in airrace.open(folder / "eight.h5").stages if stage.name != "homotopy"]


def wing_angle_in_the_pull(stage: StageView) -> float:
    """The largest angle of the wing with the horizontal up to 80 degrees of climb, degrees."""
    flight = stage.to_dataframe()
    pull = slice(0, int(np.argmax(flight["gamma_deg"].to_numpy() > 80.0)))
    attitude = rotation([flight[name].to_numpy()[pull] for name in ("q0", "q1", "q2", "q3")])
    return float(np.degrees(np.abs(np.arcsin(attitude[2][1]))).max())


def test_the_default_flight_in_still_air_stays_a_figure_in_its_plane(tmp_path: Path) -> None:
    stages = solved_stages(tmp_path)
    assert [stage.name for stage in stages] == FIDELITIES
    assert stages[-1].certified
    for stage in stages:
        flight = stage.to_dataframe()
        assert wing_angle_in_the_pull(stage) < 2.0
        off_plane = POINT_MASS_OFF_PLANE if stage.name == "point-mass" else OFF_PLANE
        assert flight["y_m"].abs().max() < off_plane
        height = flight["height_m"].to_numpy()
        assert height.min() > ENTRY_HEIGHT - 0.2  # no dive for speed
        assert 240.0 < height.max() < 290.0
        assert height[-1] == pytest.approx(ENTRY_HEIGHT, abs=0.02)


@pytest.mark.parametrize("until", ["point-mass", pytest.param("six-dof", marks=pytest.mark.slow)])
def test_in_a_crosswind_the_figure_leans_into_the_wind(tmp_path: Path, until: str) -> None:
    """The plane through the flight, east = a + b north + c height, leans to the west, where the wind comes from."""
    for stage in solved_stages(tmp_path, "--until", until, *KNOT_20_FROM_WEST):
        flight = stage.to_dataframe()
        north, east, height = (flight[name].to_numpy() for name in ("x_m", "y_m", "height_m"))
        columns = np.stack([np.ones_like(north), north, height], axis=1)
        lean = np.linalg.lstsq(columns, east, rcond=None)[0][2]
        assert -15.0 < math.degrees(math.atan(lean)) < -5.0
