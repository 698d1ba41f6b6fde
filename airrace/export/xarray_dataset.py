"""A flight as a dataset of xarray: SI units and radians, every variable with its unit and its meaning."""

from typing import TYPE_CHECKING, Any

import numpy as np

from airrace.export.csv import Provenance
from airrace.export.extras import extra
from airrace.export.flight_table import FlightTable
from airrace.procedure.result import StageResult

if TYPE_CHECKING:
    from xarray import Dataset


def flight_dataset(flight: FlightTable, result: StageResult, provenance: Provenance) -> "Dataset":
    """Return all states and controls over the dimension `time` (s), and `height` (m, above the track's origin).

    `phase` is a coordinate: the leg that each time belongs to. Controls are those of the interval in which a time lies.

    Raises:
        UsageError: xarray is not installed.
    """
    xarray: Any = extra("xarray", "a dataset")  # Any: without xarray there are no types
    histories = flight.samples.histories
    variables = {
        one.name: ("time", histories[one.name], {"units": one.unit, "long_name": one.text or one.name})
        for one in flight.quantities
    }
    if "z" in histories:
        variables["height"] = ("time", -histories["z"], {"units": "m", "long_name": "height above the track's origin"})
    return xarray.Dataset(
        variables,
        coords={
            "time": ("time", flight.samples.time, {"units": "s", "long_name": "time since the start"}),
            "phase": (
                "time",
                np.array(flight.phases),
                {"long_name": "the leg, named after its passings"},
            ),
        },
        attrs={
            "track": provenance.track,
            "aircraft": provenance.aircraft,
            "stage": result.stage.value,
            "race_time_s": result.trajectory.race_time if result.is_flight else float("nan"),
            "state": result.state.value,
            "certified": str(result.certified).lower(),
            "airrace_version": provenance.version,
        },
    )
