"""Parquet: all histories of some flights as one table, units and meanings in its metadata. Needs pyarrow."""

import io
import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airrace.files.export.globe import all_histories, stamp
from airrace.flights.results import Flight
from airrace.runtime.resources import extra


def parquet(flights: Sequence[Flight], begin: datetime) -> bytes:
    """Return a Parquet file with one row per time of every flight.

    Its columns are `flight` (the label), `time` (s), and the histories in SI units and radians.

    A history that a flight does not have is NaN in its rows. Every column has the metadata `unit`, `long_name` and
    `basis`; the table has `airrace`, a JSON object about the flights.

    Raises:
        UsageError: pyarrow is not installed.
    """
    pyarrow: Any = extra("pyarrow", "a Parquet file", "parquet")  # Any: without pyarrow there are no types
    files: Any = extra("pyarrow.parquet", "a Parquet file", "parquet")
    number = np.repeat(np.arange(len(flights), dtype=np.int32), [len(flight.time) for flight in flights])
    labels = pyarrow.DictionaryArray.from_arrays(
        _column(pyarrow, number, pyarrow.int32()), _texts(pyarrow, [flight.label for flight in flights])
    )
    columns = [labels, _column(pyarrow, np.concatenate([flight.time for flight in flights]), pyarrow.float64())]
    fields = [
        pyarrow.field("flight", labels.type, metadata={"long_name": "which flight"}),
        pyarrow.field("time", pyarrow.float64(), metadata={"unit": "s", "long_name": "time since the start"}),
    ]
    for name, history in all_histories(flights).items():
        quantity = history.quantity
        metadata = {"unit": quantity.unit, "long_name": quantity.text or name, "basis": history.basis.value}
        fields.append(pyarrow.field(name, pyarrow.float64(), metadata=metadata))
        values = np.concatenate([flight.values(name) for flight in flights])
        columns.append(_column(pyarrow, values, pyarrow.float64()))
    schema = pyarrow.schema(fields, metadata={"airrace": json.dumps(about_flights(flights, begin))})
    buffer = io.BytesIO()
    files.write_table(pyarrow.table(columns, schema=schema), buffer)
    return buffer.getvalue()


# Of numpy's arrays and of lists pyarrow makes columns only after it has loaded pandas, if that is installed.


def _column(pyarrow: Any, values: NDArray[Any], kind: Any) -> Any:  # Any: as above; numbers of `kind`
    buffer = pyarrow.py_buffer(np.ascontiguousarray(values))
    return pyarrow.Array.from_buffers(kind, len(values), [None, buffer])


def _texts(pyarrow: Any, texts: Sequence[str]) -> Any:  # Any: as above
    encoded = [text.encode("utf-8", "replace") for text in texts]
    ends = np.cumsum([0, *(len(text) for text in encoded)], dtype=np.int32)
    buffers = [None, pyarrow.py_buffer(ends), pyarrow.py_buffer(b"".join(encoded))]
    return pyarrow.Array.from_buffers(pyarrow.string(), len(texts), buffers)


def about_flights(flights: Sequence[Flight], begin: datetime) -> list[dict[str, object]]:
    """Return plain values that say which flights these are: labels, tracks, aircraft, race times and passings."""
    return [
        {
            "label": flight.label,
            "track": flight.course.name,
            "aircraft": flight.aircraft.name,
            "stage": flight.source.stage,
            "status": None if flight.source.status is None else flight.source.status.value,
            "certified": flight.source.certified,
            **flight.stamp.properties(),
            "race_time_s": flight.race_time if np.isfinite(flight.race_time) else None,
            "begin": stamp(begin, 0.0),
            "passings": [
                {"name": passing.name, "time_s": passing.time} for passing in flight.crossings if passing.found
            ],
        }
        for flight in flights
    ]
