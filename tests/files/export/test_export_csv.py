"""The exported tables say what the flight is."""

import csv
import io
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airrace.errors import UsageError
from airrace.files.export import flight_table as module
from airrace.files.export.csv import FlightOrigin, export_csv
from airrace.files.export.flight_table import (
    Samples,
    at_nodes,
    at_times,
    flight_frame,
    flight_table,
    times_at_rate,
    unit_suffix,
)
from airrace.files.export.netcdf import flight_dataset
from airrace.flights.results import Stamp
from airrace.model.frames import quaternion
from airrace.optimal_control.certificate import Certificate, Item
from airrace.optimal_control.quantities import Quantity
from airrace.optimal_control.trajectory import Array, Trajectory
from airrace.pages.views.stage_tables import splits_table
from airrace.procedure.result import GateSplit, StageResult, Status, Timings
from airrace.procedure.stage import Stage

INTERVALS = 12
NODES = np.arange(INTERVALS + 1)
TIME = 0.31 * NODES + 0.013 * np.sin(NODES)
TIME -= TIME[0]
COURSE, CLIMB, BANK = 0.5 + 0.25 * NODES, 0.4 * np.sin(NODES), 0.3 * NODES - 1.0
ATTITUDES = np.array([quaternion(*angles) for angles in zip(COURSE, CLIMB, BANK, strict=True)]).T
FLIPPING = ATTITUDES * np.where(NODES % 3 == 0, -1.0, 1.0)  # q and -q are one attitude

SPLITS = (
    GateSplit("1:g1", 1.25, 90.0, 21.5, 4.0, 0.1, -0.05, 3.0),
    GateSplit("1:g2", 3.75, 85.0, 20.0, 7.5, -math.pi / 2, 0.0, -1e-12),
)
STAMP = Stamp("point-mass", Status.CERTIFIED, (), "Edge 540", "still air", "race")
PROVENANCE = FlightOrigin("Rovinj\n2014", STAMP, "0.1.0")


def at_rate(trajectory: Trajectory, rate: float) -> Samples:
    return at_times(trajectory, times_at_rate(trajectory, rate))


def flight() -> Trajectory:
    names = ("x", "y", "z", "V_K", "q0", "q1", "q2", "q3", "p_rate")
    units = ("m", "m", "m", "m/s", "1", "1", "1", "1", "rad/s")
    state = np.vstack([1234.56789 * np.cos(TIME), -50.0 * TIME, -20.0 - TIME, 90.0 + TIME, FLIPPING, 0.1 * TIME])
    return Trajectory(
        phases=("start -> g1", "g1, inside -> finish"),
        first_node=np.array([0, 5, INTERVALS], np.int64),
        durations=np.array([TIME[5], TIME[-1] - TIME[5]]),
        time=TIME,
        states=tuple(Quantity(name, unit) for name, unit in zip(names, units, strict=True)),
        state=state,
        controls=(Quantity("n_z_cmd_dot", "1/s"), Quantity("p_cmd", "rad/s")),
        control=np.array([np.linspace(1.0, 9.0, INTERVALS), np.linspace(-1.0, 1.0, INTERVALS)]),
    )


def result(trajectory: Trajectory | None = None) -> StageResult:
    return StageResult(
        stage=Stage.POINT_MASS,
        outcome=Status.SOLVED,
        message="solved",
        trajectory=trajectory or flight(),
        constraint_multipliers=np.zeros(0),
        bound_multipliers=np.zeros(0),
        certificate=Certificate("ok", (Item("kkt_error", 1e-9, 1e-6), Item("race_time_change", 1e-3, 5e-3, "s"))),
        splits=SPLITS,
        attempts=(),
        timings=Timings(0.0, 0.0, 0.0),
    )


def table(text: str) -> dict[str, list[str]]:
    """The columns by header, comments left out."""
    rows = list(csv.reader(line for line in io.StringIO(text) if not line.startswith("#")))
    assert len(set(rows[0])) == len(rows[0])
    return {header: [row[index] for row in rows[1:]] for index, header in enumerate(rows[0])}


def exported(**options: object) -> dict[str, list[str]]:
    stream = io.StringIO(newline="")
    export_csv(result(), stream, **options)
    return table(stream.getvalue())


def floats(column: list[str]) -> Array:
    return np.array(column, np.float64)


def test_the_mesh_is_exported_as_it_is() -> None:
    columns = exported()
    trajectory = flight()
    np.testing.assert_allclose(floats(columns["time_s"]), TIME, atol=1e-6, rtol=0)
    for name, header in {"x": "x_m", "z": "z_m", "V_K": "V_K_m_s", "q0": "q0", "q3": "q3"}.items():
        np.testing.assert_allclose(floats(columns[header]), trajectory[name], atol=1e-6, rtol=0)
    np.testing.assert_allclose(floats(columns["height_m"]), 20.0 + TIME, atol=1e-6)
    np.testing.assert_allclose(floats(columns["V_K_kt"]) * 1852 / 3600, trajectory["V_K"], atol=1e-6, rtol=0)
    np.testing.assert_allclose(np.radians(floats(columns["p_rate_deg_s"])), trajectory["p_rate"], atol=1e-6)
    # A control holds over its interval, the last one stays; a row at a gate belongs to the phase that begins there.
    control = trajectory["n_z_cmd_dot"]
    np.testing.assert_allclose(floats(columns["n_z_cmd_dot_per_s"]), [*control, control[-1]], atol=1e-6)
    first, second = trajectory.phases
    assert columns["phase"] == [first] * 5 + [second] * (INTERVALS - 4)
    for header, angle in {"chi_deg": COURSE, "gamma_deg": CLIMB, "mu_deg": BANK}.items():
        difference = np.radians(floats(columns[header])) - angle
        np.testing.assert_allclose(np.exp(1j * difference), 1.0, atol=1e-6)
    states = ["x_m", "y_m", "z_m", "V_K_m_s", "V_K_kt", "q0", "q1", "q2", "q3", "p_rate_deg_s"]
    controls = ["n_z_cmd_dot_per_s", "p_cmd_deg_s"]
    derived = ["height_m", "chi_deg", "gamma_deg", "mu_deg"]
    assert list(columns) == ["time_s", *states, *controls, *derived, "phase"]


@pytest.mark.parametrize(
    ("unit", "suffix"),
    [("m/s", "m_s"), ("m/s^2", "m_s2"), ("m/s²", "m_s2"), ("1", ""), ("", ""), ("1/s", "per_s"), ("deg/s", "deg_s")],
)
def test_a_unit_is_written_in_letters_that_every_program_takes(unit: str, suffix: str) -> None:
    assert unit_suffix(unit) == suffix


@given(rate=st.floats(0.05, 500.0))
def test_a_fixed_rate_covers_the_race_from_start_to_end(rate: float) -> None:
    time = at_rate(flight(), rate).time
    steps = np.diff(time)
    assert time[0] == 0.0
    assert time[-1] == TIME[-1]
    np.testing.assert_allclose(steps[:-1], 1.0 / rate, rtol=1e-9)
    assert 0.0 < steps[-1] <= (1.0 + 1e-5) / rate


def test_a_rate_that_fits_the_race_does_not_repeat_its_end() -> None:
    trajectory = replace(flight(), time=np.linspace(0.0, 3.3, INTERVALS + 1))
    assert len(at_rate(trajectory, 10.0).time) == 34
    assert len(at_rate(trajectory, 20.0).time) == 67
    assert len(at_rate(trajectory, 7.0).time) == 25  # 0 ... 23 sevenths, and the end


def test_between_the_nodes_states_are_linear_and_controls_constant() -> None:
    columns = exported(rate_hz=100.0)
    time = floats(columns["time_s"])
    np.testing.assert_allclose(floats(columns["y_m"]), -50.0 * time, atol=1e-6)
    index = int(np.searchsorted(time, 0.5 * (TIME[3] + TIME[4])))
    assert float(columns["n_z_cmd_dot_per_s"][index]) == pytest.approx(flight()["n_z_cmd_dot"][3])


def test_a_rate_that_meets_the_nodes_gives_what_the_mesh_gives() -> None:
    trajectory = replace(flight(), time=np.linspace(0.0, 3.0, INTERVALS + 1))
    mesh, sampled = at_nodes(trajectory), at_rate(trajectory, 4.0)
    np.testing.assert_array_equal(sampled.phase, mesh.phase)
    for name in ("x", "V_K", "p_cmd", "n_z_cmd_dot"):
        np.testing.assert_allclose(sampled.histories[name], mesh.histories[name], rtol=1e-12)


def test_quaternions_of_flipping_sign_are_interpolated_the_short_way() -> None:
    samples = at_rate(flight(), 200.0)
    q = np.array([samples.histories[name] for name in ("q0", "q1", "q2", "q3")])
    np.testing.assert_allclose(np.linalg.norm(q, axis=0), 1.0, rtol=1e-12)
    # The attitude turns by less than 0.7 rad from node to node: each sample is within that of the node before it.
    node = np.searchsorted(TIME, samples.time, side="right") - 1
    cosines = np.abs(np.sum(q * ATTITUDES[:, node], axis=0))
    assert 2.0 * np.arccos(cosines.min()) < 0.7
    # And from sample to sample it neither jumps nor changes its sign.
    assert np.sum(q[:, 1:] * q[:, :-1], axis=0).min() > 0.999


def test_a_sampler_gives_the_states_and_may_give_controls() -> None:
    trajectory = flight()

    def sampler(time: Array) -> dict[str, Array]:
        states = {quantity.name: np.full(len(time), 0.5) for quantity in trajectory.states}
        return {**states, "x": time**2, "p_cmd": time}

    columns = exported(rate_hz=50.0, sampler=sampler)
    time = floats(columns["time_s"])
    np.testing.assert_allclose(floats(columns["x_m"]), time**2, atol=1e-6)
    np.testing.assert_allclose(np.radians(floats(columns["p_cmd_deg_s"])), time, atol=1e-6)
    assert float(columns["n_z_cmd_dot_per_s"][-1]) == pytest.approx(9.0)


def test_derived_columns_follow_in_their_own_units() -> None:
    derived = {
        Quantity("alpha_A", "rad"): lambda histories: np.radians(histories["V_K"]),
        Quantity("qbar", "Pa"): lambda histories: 0.6 * histories["V_K"] ** 2,
    }
    columns = exported(derived=derived)
    speed = flight()["V_K"]
    np.testing.assert_allclose(floats(columns["alpha_A_deg"]), speed, atol=1e-6)
    np.testing.assert_allclose(floats(columns["qbar_Pa"]), 0.6 * speed**2, atol=1e-6)


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf, 1e9])
def test_an_impossible_rate_is_a_usage_error(rate: float) -> None:
    with pytest.raises(UsageError, match="rate"):
        at_rate(flight(), rate)


def test_a_flight_without_a_finite_duration_can_only_be_exported_on_its_mesh() -> None:
    lost = replace(flight(), time=np.full(INTERVALS + 1, math.nan))
    with pytest.raises(UsageError, match="finite"):
        at_rate(lost, 10.0)
    stream = io.StringIO(newline="")
    export_csv(result(lost), stream)
    assert table(stream.getvalue())["time_s"] == ["nan"] * (INTERVALS + 1)


def test_comments_say_whose_flight_it_is_one_line_each() -> None:
    stream = io.StringIO(newline="")
    export_csv(result(), stream, provenance=PROVENANCE)
    comments = [line for line in stream.getvalue().splitlines() if line.startswith("#")]
    assert comments == [
        "# track: Rovinj 2014",
        "# aircraft: Edge 540",
        "# stage: point-mass",
        f"# race time: {TIME[-1]:.6f} s",
        "# certified: yes; air: still air; pilot's limits: race; reserve: none",
        "# airrace version: 0.1.0",
    ]


@pytest.mark.parametrize("outcome", [Status.INFEASIBLE, Status.NOT_CONVERGED, Status.TIMEOUT])
def test_comments_claim_no_race_time_where_no_flight_was_found(outcome: Status) -> None:
    stream = io.StringIO()
    export_csv(replace(result(), outcome=outcome), stream, provenance=PROVENANCE)
    comments = [line for line in stream.getvalue().splitlines() if line.startswith("#")]
    assert not any("race time" in line for line in comments)
    assert f"# flight: none was found ({outcome.value}); this is where the solver gave up" in comments


def test_splits_are_exported_with_their_legs() -> None:
    columns = table(splits_table(result().splits).csv(".10g"))
    expected = {
        "passage": ["1:g1", "1:g2"],
        "time_s": [1.25, 3.75],
        "leg_s": [1.25, 2.5],
        "V_K_kt": [90.0 * 3600 / 1852, 85.0 * 3600 / 1852],
        "V_K_m_s": [90.0, 85.0],
        "height_m": [21.5, 20.0],
        "n_z": [4.0, 7.5],
        "bank_deg": [math.degrees(0.1), -90.0],
        "climb_deg": [math.degrees(-0.05), 0.0],
        "heading_deg": [math.degrees(3.0), 0.0],
    }
    assert list(columns) == list(expected)
    assert columns.pop("passage") == expected.pop("passage")
    for header, values in expected.items():
        np.testing.assert_allclose(floats(columns[header]), values, atol=1e-6)
    frame = splits_table(SPLITS).dataframe("passage")
    assert [frame.index.name, *frame.columns] == ["passage", *expected]
    assert frame.index.tolist() == ["1:g1", "1:g2"]
    np.testing.assert_allclose(frame.to_numpy(), np.column_stack([*map(floats, columns.values())]), rtol=1e-9)
    assert table(splits_table(()).csv())["passage"] == []


@given(heading=st.floats(-20.0, 20.0))
def test_a_heading_lies_on_the_compass(heading: float) -> None:
    splits = splits_table((replace(SPLITS[0], heading=heading),))
    degrees = float(table(splits.csv(".10g"))["heading_deg"][0])
    assert 0.0 <= degrees < 360.0
    assert math.remainder(degrees - math.degrees(heading), 360.0) == pytest.approx(0.0, abs=1e-6)


def test_a_table_of_any_rate_is_made_in_pieces_and_stays_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def sampler(time: Array) -> dict[str, Array]:
        asked.append(len(time))
        return {quantity.name: 2.0 + np.sin(time) for quantity in flight().states}

    options = ({"rate_hz": 500.0}, {"rate_hz": 500.0, "sampler": sampler}, {})
    whole = [exported(**one) for one in options]
    (rows,) = asked
    assert rows == len(whole[1]["time_s"]) > 1000
    monkeypatch.setattr(module, "ROWS_AT_ONCE", 7)
    assert [exported(**one) for one in options] == whole
    assert sum(asked[1:]) == rows
    assert max(asked[1:]) == 7


@pytest.mark.parametrize("rate", [None, 4.0])
def test_a_data_frame_is_the_table_of_the_csv_file(rate: float | None) -> None:
    stream = io.StringIO()
    export_csv(result(), stream, rate_hz=rate)
    heads, *rows = csv.reader(line for line in stream.getvalue().splitlines() if not line.startswith("#"))
    frame = flight_frame(flight_table(flight(), rate_hz=rate))
    assert [frame.index.name, *frame.columns] == heads
    assert len(frame) == len(rows)
    written = np.array([[float(cell) for cell in row[:-1]] for row in rows])
    held = np.column_stack([frame.index.to_numpy(), frame.drop(columns="phase").to_numpy(np.float64)])
    np.testing.assert_allclose(held, written, rtol=1e-9)
    assert frame["phase"].tolist() == [row[-1] for row in rows]


def test_a_dataset_holds_every_history_in_its_own_unit() -> None:
    trajectory = flight()
    dataset = flight_dataset(flight_table(trajectory), result(), PROVENANCE)
    np.testing.assert_array_equal(dataset["time"], trajectory.time)
    for declared, rows in ((trajectory.states, trajectory.state), (trajectory.controls, trajectory.control)):
        for quantity, row in zip(declared, rows, strict=True):
            name, sign = {"x": ("north", 1.0), "y": ("east", 1.0), "z": ("height", -1.0)}.get(
                quantity.name, (quantity.name, 1.0)
            )
            held = dataset[name]
            assert held.attrs["units"] == quantity.unit
            np.testing.assert_array_equal(held.values[: len(row)], sign * row)
    assert not {"x", "y", "z"} & set(dataset.variables)
    assert set(dataset["phase"].values.tolist()) == set(trajectory.phases)
    assert dataset.attrs["race_time_s"] == trajectory.race_time
    assert dataset.attrs["aircraft"] == STAMP.aircraft
