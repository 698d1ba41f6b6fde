"""Flights and gate splits as data frames of pandas."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from airrace.export.extras import extra
from airrace.export.flight_table import FlightTable, split_columns
from airrace.procedure.result import GateSplit

if TYPE_CHECKING:
    from pandas import DataFrame


def flight_frame(flight: FlightTable) -> "DataFrame":
    """Return a data frame of the flight, with one row per time.

    `time_s` is the index, and the leg of each row is the category `phase`.

    Raises:
        UsageError: pandas is not installed.
    """
    pandas: Any = extra("pandas", "a data frame")  # Any: without pandas there are no types
    time, *columns = flight.columns
    index = pandas.Index(time.values, name=time.header)
    frame = pandas.DataFrame({column.header: column.values for column in columns}, index=index)
    frame["phase"] = pandas.Categorical(flight.phases, categories=list(dict.fromkeys(flight.phases)))
    return frame


def splits_frame(splits: Sequence[GateSplit]) -> "DataFrame":
    """Return a data frame of the gate splits, with one row per passing and its name, `passage`, as the index.

    Raises:
        UsageError: pandas is not installed.
    """
    pandas: Any = extra("pandas", "a data frame")  # Any: as above
    index = pandas.Index([split.name for split in splits], name="passage")
    return pandas.DataFrame({column.header: column.values for column in split_columns(splits)}, index=index)
