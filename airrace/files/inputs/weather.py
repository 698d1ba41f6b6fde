"""The weather of an hour as pilots are told it, wind, QNH and temperature; and files of many hours."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from airrace.errors import UsageError
from airrace.files.inputs.air import Wind, overrides_of
from airrace.flights.logs.recording import refuse
from airrace.model.environment import LAPSE, P_ISA, PRESSURE_EXPONENT, T_ISA, Air

FREEZING = 273.15
"""0 degrees Celsius, K."""
WIND_FROM, WIND_SPEED, QNH, TEMPERATURE = "from_deg", "speed_kt", "qnh_hPa", "temperature_C"
RANGES = {WIND_FROM: (0.0, 360.0), WIND_SPEED: (0.0, 100.0), QNH: (914.0, 1113.0), TEMPERATURE: (-45.0, 60.0)}
"""The least and the largest number of every column of a file of hours."""


@dataclass(frozen=True)
class Weather:
    """The weather of an hour; None for what the course says.

    Attributes:
        hour: its name; empty where there is only one.
        wind: at the reference height of the course's wind.
        qnh: the pressure that an altimeter is set to, hPa.
        temperature: at the height of the course's origin, degrees Celsius.
    """

    hour: str = ""
    wind: Wind | None = None
    qnh: float | None = None
    temperature: float | None = None

    def overrides(self, air: Air) -> list[str]:
        """Return the `key=value` texts that give a course this weather.

        The QNH is the pressure at the course reduced to the level of the sea through the standard atmosphere, so the
        pressure there in air of another temperature is another.

        Args:
            air: as the course says.
        """
        texts = [] if self.wind is None else [f"{key}={value}" for key, value in overrides_of(self.wind)]
        standard = T_ISA - LAPSE * air.elevation
        offset = air.temperature_offset
        if self.temperature is not None:
            offset = round(self.temperature + FREEZING - standard, 9)
            texts.append(f"environment.temperature_offset_K={offset:.10g}")
        if self.qnh is not None:
            ratio = (standard / T_ISA) / ((standard + offset) / (T_ISA + offset))
            pressure = self.qnh * ratio**PRESSURE_EXPONENT
            texts.append(f"environment.pressure_offset_hPa={round(pressure - P_ISA / 100.0, 9):.10g}")
        return texts


def weather_named(wind: str | None, qnh: float | None, temperature: float | None) -> Weather:
    """Return the weather that is asked for.

    Args:
        wind: such as `240/12`, from 240 degrees with 12 kt.
        qnh, temperature: see `Weather`.

    Raises:
        UsageError: the wind is none, or a number is out of range.
    """
    origin, _, speed = (wind or "/").partition("/")
    if wind is not None and not (origin and speed):
        raise UsageError(f"--wind {wind}: expected degrees and knots, such as 240/12")
    numbers = {QNH: qnh, TEMPERATURE: temperature}
    cells = {name: str(value) for name, value in numbers.items() if value is not None}
    try:
        return _weather({WIND_FROM: origin, WIND_SPEED: speed, **cells}, Weather())
    except CellError as error:
        name, message = error.args
        option = "wind" if name in (WIND_FROM, WIND_SPEED) else name.partition("_")[0]
        raise UsageError(f"--{option}: {name}: {message}") from error


def read_hours(path: Path, common: Weather) -> list[Weather]:
    """Return the weather of every row of a CSV file.

    Args:
        path: with the columns `hour` and any of `from_deg` and `speed_kt`, `qnh_hPa`, `temperature_C`.
        common: holds where a cell is empty, or a column missing.

    Raises:
        InputError: the file cannot be read, or a row is not valid; it names the line.
    """
    file = str(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is no UTF-8 text"
        refuse(file, 0, f"cannot be read: {reason}")
    reader, hours = csv.reader(text.splitlines(), skipinitialspace=True), dict[str, Weather]()
    try:
        names = _columns(file, next(reader, list[str]()))
        for row in reader:
            values = [value.strip() for value in row]
            if not any(values):
                continue  # spreadsheets write rows of commas
            cells, line = dict(zip(names, values, strict=False)), reader.line_num
            hour = cells.get("hour", "")
            if any(values[len(names) :]):
                refuse(file, line, "more cells than columns")
            if not hour:
                refuse(file, line, "the hour has no name")
            if hour in hours:
                refuse(file, line, f"{hour} stands there twice", "hour")
            try:
                hours[hour] = _weather(cells, replace(common, hour=hour))
            except CellError as error:
                name, message = error.args
                refuse(file, line, message, name)
    except csv.Error as error:
        refuse(file, reader.line_num, f"is no line of a CSV file: {error}")
    if not hours:
        refuse(file, 1, "there is no hour in it")
    return list(hours.values())


def _columns(file: str, heads: Sequence[str]) -> list[str]:
    """Return the names of the columns of a file of hours."""
    known, names = ("hour", *RANGES), [head.strip() for head in heads]
    while names and not names[-1]:
        names.pop()
    if "hour" not in names:
        refuse(file, 1, f"there is no column `hour`; the columns are {', '.join(known)}")
    if unknown := [name for name in names if name not in known]:
        refuse(file, 1, f"there is no such column; known are {', '.join(known)}", unknown[0])
    return names


class CellError(ValueError):
    """A number of a weather that is not valid: its name, and a clause that says why."""


def _weather(cells: Mapping[str, str], common: Weather) -> Weather:
    """Return the weather of texts by their names; empty ones are those of another weather.

    Raises:
        CellError: a text is no number, or none in its range.
    """
    numbers: dict[str, float] = {}
    for name, (low, high) in RANGES.items():
        text = cells.get(name, "")
        try:
            number = float(text or "nan")
        except ValueError as error:
            raise CellError(name, f"`{text[:40]}` is no number") from error
        if text and not low <= number <= high:
            raise CellError(name, f"must lie between {low:g} and {high:g}, not {text[:40]}")
        if text:
            numbers[name] = number
    wind, speed, origin = common.wind, numbers.get(WIND_SPEED), numbers.get(WIND_FROM)
    if speed is not None and (origin is not None or speed == 0.0):
        wind = Wind(speed, origin or 0.0)
    elif speed is not None or origin is not None:
        raise CellError(WIND_FROM, f"a wind needs both its direction, `{WIND_FROM}`, and its speed, `{WIND_SPEED}`")
    return Weather(common.hour, wind, numbers.get(QNH, common.qnh), numbers.get(TEMPERATURE, common.temperature))
