"""`scripts/measure_flyability.py` finds in tables of known flights what was put there."""

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
SPEED, RADIUS = 100.0, 120.0
KINDS = {"a": "gate", "b": "pylon", "c": "gate"}


@pytest.fixture(scope="module", name="script")
def loaded_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("measure_flyability", ROOT / "scripts" / "measure_flyability.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where a dataclass looks for the types of its fields
    spec.loader.exec_module(module)
    return module


def write_flight(folder: Path, *, circle: bool, names: tuple[str, str, str] = ("0:a", "1:b", "1:c")) -> list[Path]:
    """Write a flight as the export does: 4 s northward, perhaps once round to the right, 4 s northward.

    It rolls with 40 deg/s at first, and passes `1:b` with 95 deg/s, 0.2 g of lateral load and -3 degrees of sideslip.
    At 2 s its load factor is -0.3 g; from 1.9 s before the end on it is -1.5 g for 1 s, with flanks of 0.1 s.
    """
    around = 2.0 * math.pi * RADIUS / SPEED if circle else 0.0
    end = 8.0 + around
    time = np.unique(np.concatenate((np.arange(0.0, end, 0.01), [4.0, end])))
    chi = np.clip(time - 4.0, 0.0, around) * SPEED / RADIUS
    straight = np.minimum(time, 4.0) + np.maximum(time - 4.0 - around, 0.0)
    x, y = SPEED * straight + RADIUS * np.sin(chi), RADIUS * (1.0 - np.cos(chi))
    p = np.interp(time, [0.0, 3.0, 4.0, 5.0, end], [40.0, 40.0, 95.0, 0.0, 0.0])
    mu = np.radians(np.concatenate(([0.0], np.cumsum(0.5 * (p[1:] + p[:-1]) * np.diff(time)))))
    late = end - 1.9
    n_z = np.interp(time, [1.9, 2.0, 2.1, late - 0.1, late, late + 1.0, late + 1.1], [1, -0.3, 1, 1, -1.5, -1.5, 1])
    q = (np.cos(chi / 2) * np.cos(mu / 2), np.cos(chi / 2) * np.sin(mu / 2),
         np.sin(chi / 2) * np.sin(mu / 2), np.sin(chi / 2) * np.cos(mu / 2))  # fmt: skip
    columns = {
        "time_s": time,
        "x_m": x,
        "y_m": y,
        "V_K_m_s": np.full_like(time, SPEED),
        **{f"q{part}": values for part, values in enumerate(q)},
        "height_m": np.where(time < late - 1.0, 20.0, 60.0),
        "chi_deg": np.degrees(np.arctan2(np.sin(chi), np.cos(chi))),
        "gamma_deg": np.zeros_like(time),
        "n_z": n_z,
        "n_y": np.interp(time, [3.0, 4.0, 5.0], [0.01, 0.2, 0.0]),
        "beta_A_deg": np.interp(time, [0.0, 4.0, end], [1.5, -3.0, 0.5]),
        "p_Kbar_deg_s": p,
    }
    node = np.isin(time, [0.0, 4.0, end])
    for name, rows in (("nodes.csv", node), ("fine.csv", ~node)):
        lines = ["# track: known", "# certified: yes", ",".join((*columns, "phase"))]
        for row in np.flatnonzero(rows):
            lines.append(",".join((*(f"{values[row]:.10g}" for values in columns.values()), "leg")))
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    splits = [f"{name},{at:.10g}" for name, at in zip(names, (0.0, 4.0, end), strict=True)]
    (folder / "nodes.splits.csv").write_text("\n".join(("passage,time_s", *splits)) + "\n", encoding="utf-8")
    return [folder / "nodes.csv", folder / "fine.csv"]


def test_everything_that_was_put_into_a_flight_is_found_in_its_table(tmp_path: Path, script: ModuleType) -> None:
    tables = write_flight(tmp_path, circle=True)
    flight = script.measure(script.recording(tables, tmp_path / "nodes.splits.csv", KINDS))
    assert flight.race_time == pytest.approx(8.0 + 2.0 * math.pi * RADIUS / SPEED)
    assert flight.certified
    places = ("start", "gates", "finish")
    assert [flight.largest(place, "roll_rate") for place in places] == pytest.approx([40.0, 95.0, 0.0])
    assert [flight.largest(place, "n_y") for place in places] == pytest.approx([0.01, 0.2, 0.0])
    assert [flight.largest(place, "beta") for place in places] == pytest.approx([1.5, 3.0, 0.5])
    assert flight.low_load == pytest.approx(-0.3, abs=0.02)
    assert flight.push == pytest.approx(1.0 + 2 * 0.1 * (1.5 - 1.02) / 2.5, abs=0.005)
    assert flight.circles == {"1:b -> 1:c": pytest.approx(360.0, abs=1e-3)}
    assert not any(flight.verdicts().values())


def test_the_attitude_tells_the_roll_rate_of_its_column(tmp_path: Path, script: ModuleType) -> None:
    tables = write_flight(tmp_path, circle=True)
    flight = script.recording(tables, tmp_path / "nodes.splits.csv", KINDS)
    corners = np.isin(np.round(flight.columns["time_s"], 2), [3.0, 4.0, 5.0])
    difference = script.differentiated_roll_rate(flight) - flight.columns["p_Kbar_deg_s"]
    assert np.abs(difference[~corners]).max() < 0.5
    assert np.abs(difference).max() < 1.0


def test_what_is_flown_at_and_between_manoeuvres_is_no_fault_of_a_gate(tmp_path: Path, script: ModuleType) -> None:
    tables = write_flight(tmp_path, circle=True, names=("0:up", "1:over/begin", "1:c#2"))
    flight = script.measure(script.recording(tables, tmp_path / "nodes.splits.csv", {"c": "gate"}))
    assert math.isnan(flight.largest("gates", "roll_rate"))
    assert flight.low_load == 1.0  # of the leg to the gate
    assert flight.verdicts()["roll rate"]
    assert list(flight.circles) == ["1:over/begin -> 1:c#2"]


def test_a_leg_that_needs_no_circle_and_flies_none_has_none(tmp_path: Path, script: ModuleType) -> None:
    tables = write_flight(tmp_path, circle=False)
    flight = script.recording(tables, tmp_path / "nodes.splits.csv", KINDS)
    assert script.needless_turn(flight, 4.0, 8.0) == 0.0
    assert script.measure(flight).circles == {}


def test_a_place_behind_needs_a_whole_turn_and_one_aside_needs_none(script: ModuleType) -> None:
    assert script.shortest_path_turn((0.0, 0.0, 0.0), (-50.0, 0.0, 0.0), 100.0) == pytest.approx(360.0)
    assert script.shortest_path_turn((0.0, 0.0, 0.0), (900.0, 100.0, 0.0), 100.0) == pytest.approx(0.0, abs=1e-9)
    assert script.shortest_path_turn((0.0, 0.0, 0.0), (0.0, 200.0, math.pi), 100.0) == pytest.approx(180.0)


def test_half_a_loop_is_half_a_turn_to_either_side_and_no_circle(script: ModuleType) -> None:
    chi = np.array([10.0, 0.0, 0.0, -90.0, 180.0, 170.0, 170.0])
    gamma = np.array([0.0, 40.0, 70.0, 89.0, 70.0, 40.0, 0.0])
    assert abs(script._turned(chi, gamma)) == pytest.approx(160.0)
