"""FIT files of sports watches and cycle computers, by the library fitdecode: the records with a time and a place."""

import math
from datetime import datetime
from typing import IO, Any

import numpy as np

from airrace.errors import InputError
from airrace.logs.clocks import instant
from airrace.logs.recording import LIMITS, Recording, SampleTable, refuse
from airrace.resources import extra

SEMICIRCLE = math.pi / 2**31
"""The unit of latitude and longitude, rad."""


def read_fit(path: str, file: IO[bytes]) -> Recording:
    """Return the records of a FIT file: latitude, longitude, altitude and ground speed.

    Args:
        path: of the file, for messages.
        file: at its start.

    Raises:
        InputError: it is damaged before the second record, or holds no records with a place.
        UsageError: fitdecode is not installed.
    """
    fitdecode: Any = extra("fitdecode", "a FIT file", "fit")  # Any: it has no types
    samples = SampleTable(path, 5, "record")
    options = {"check_crc": fitdecode.CrcCheck.DISABLED, "error_handling": fitdecode.ErrorHandling.IGNORE}
    number = 0
    try:
        with fitdecode.FitReader(file, **options) as frames:
            for frame in frames:
                if not isinstance(frame, fitdecode.FitDataMessage) or frame.name != "record":
                    continue
                number += 1
                if number - len(samples.lines) > LIMITS.idle:
                    refuse(path, number, f"has more than {LIMITS.idle} records without a place")
                _append(samples, number, {one.name: one.value for one in frame.fields})
    except InputError:
        raise
    except Exception as error:  # of damaged bytes fitdecode raises whatever becomes of them
        why = str(error) or type(error).__name__
        if len(samples.lines) < 2:
            refuse(path, 0, f"is a damaged FIT file: {why}")
        samples.leave_out(number + 1, f"is damaged: {why}", "rest")
    numbers, (time, latitude, longitude, altitude, speed) = samples.arrays("holds no records with time and place")
    columns = {"latitude": latitude, "longitude": longitude, "altitude": altitude, "V_G": speed}
    columns = {name: values for name, values in columns.items() if np.isfinite(values).any()}
    remarks = (*samples.remarks, "times are whole seconds, as FIT writes them")
    return Recording(path, "fit", time - time[0], columns, numbers, instant(float(time[0])), remarks)


def _append(samples: SampleTable, number: int, values: dict[str, Any]) -> None:  # Any: as fitdecode decodes them
    when = values.get("timestamp")
    if not isinstance(when, datetime):
        samples.leave_out(number, "has no time", "timestamp")
        return
    place = [_number(values.get(name)) * SEMICIRCLE for name in ("position_lat", "position_long")]
    altitude, speed = (
        next(
            (one for one in (_number(values.get(f"{better}{name}")) for better in ("enhanced_", "")) if one == one),
            math.nan,
        )
        for name in ("altitude", "speed")
    )
    samples.append(number, when.timestamp(), *place, altitude, speed)


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
