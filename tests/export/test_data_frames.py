"""Data frames and datasets hold the flight that CSV files hold, with units."""

import csv
import io

import numpy as np
import pytest
from test_export_csv import PROVENANCE, SPLITS, flight, result

from airrace.export.csv import export_csv
from airrace.export.flight_table import flight_frame, flight_table
from airrace.export.netcdf import flight_dataset
from airrace.views.stage_tables import splits_table


@pytest.mark.parametrize("rate", [None, 4.0])
def test_a_data_frame_is_the_table_of_the_csv_file(rate: float | None) -> None:
    stream = io.StringIO()
    export_csv(result(), stream, rate_hz=rate, comments=False)
    heads, *rows = csv.reader(stream.getvalue().splitlines())
    frame = flight_frame(flight_table(flight(), rate_hz=rate))
    assert [frame.index.name, *frame.columns] == heads
    assert len(frame) == len(rows)
    written = np.array([[float(cell) for cell in row[:-1]] for row in rows])
    held = np.column_stack([frame.index.to_numpy(), frame.drop(columns="phase").to_numpy(np.float64)])
    np.testing.assert_allclose(held, written, rtol=1e-9)
    assert frame["phase"].tolist() == [row[-1] for row in rows]


def test_a_data_frame_of_splits_is_the_table_of_the_csv_file() -> None:
    stream = io.StringIO()
    stream.write(splits_table(SPLITS).csv(".10g"))
    heads, *rows = csv.reader(stream.getvalue().splitlines())
    frame = splits_table(SPLITS).dataframe("passage")
    assert [frame.index.name, *frame.columns] == heads
    assert frame.index.tolist() == [row[0] for row in rows]
    np.testing.assert_allclose(frame.to_numpy(), [[float(cell) for cell in row[1:]] for row in rows], rtol=1e-9)


def test_a_dataset_holds_every_history_in_its_own_unit() -> None:
    trajectory = flight()
    dataset = flight_dataset(flight_table(trajectory), result(), PROVENANCE)
    np.testing.assert_array_equal(dataset["time"], trajectory.time)
    for declared, rows in ((trajectory.states, trajectory.state), (trajectory.controls, trajectory.control)):
        for quantity, row in zip(declared, rows, strict=True):
            held = dataset[quantity.name]
            assert held.attrs["units"] == quantity.unit
            np.testing.assert_array_equal(held.values[: len(row)], row)
    assert set(dataset["phase"].values.tolist()) == set(trajectory.phases)
    assert dataset.attrs["race_time_s"] == trajectory.race_time
    assert dataset.attrs["aircraft"] == PROVENANCE.aircraft
