"""The weather of an hour as pilots are told it, wind, QNH and temperature; and files of many hours."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from airrace.errors import Finding, InputError, UsageError
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
    numbers = {QNH: qnh, TEMPERATURE: temperature}
    if wind is not None:
        try:
            numbers[WIND_FROM], numbers[WIND_SPEED] = map(float, wind.split("/"))
        except ValueError as error:
            raise UsageError(f"--wind {wind}: expected degrees and knots, such as 240/12") from error
    for name, value in numbers.items():
        low, high = RANGES[name]
        if value is not None and not low <= value <= high:
            option = "wind" if name in (WIND_FROM, WIND_SPEED) else name.partition("_")[0]
            raise UsageError(f"--{option}: {name} must lie between {low:g} and {high:g}, not {value:g}")
    speed, origin = numbers.get(WIND_SPEED), numbers.get(WIND_FROM)
    return Weather("", None if speed is None or origin is None else Wind(speed, origin), qnh, temperature)


def read_hours(path: Path, common: Weather) -> list[Weather]:
    """Return the weather of every row of a CSV file.

    Args:
        path: with the columns `hour` and any of `from_deg` and `speed_kt`, `qnh_hPa`, `temperature_C`.
        common: holds where a cell is empty, or a column missing.

    Raises:
        InputError: the file cannot be read, or a row is not valid; it names the line.
    """
    try:
        reader = csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines(), skipinitialspace=True)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is no UTF-8 text"
        raise InputError([Finding(str(path), 0, 0, "", f"cannot be read: {reason}")]) from error
    known = ("hour", *RANGES)
    reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
    if "hour" not in reader.fieldnames:
        refuse(str(path), 1, f"there is no column `hour`; the columns are {', '.join(known)}")
    if unknown := [name for name in reader.fieldnames if name not in known]:
        refuse(str(path), 1, f"there is no such column; known are {', '.join(known)}", unknown[0])
    hours = [_hour(path, reader.line_num, row, common) for row in reader]
    if not hours:
        refuse(str(path), 1, "there is no hour in it")
    names = [weather.hour for weather in hours]
    if twice := next((name for name in names if names.count(name) > 1), None):
        refuse(str(path), 0, f"{twice} stands there twice", "hour")
    return hours


def _hour(path: Path, line: int, row: Mapping[str | None, str | list[str] | None], common: Weather) -> Weather:
    cells = {str(key): text.strip() for key, text in row.items() if isinstance(text, str)}
    if None in row or not cells.get("hour"):
        refuse(str(path), line, "more cells than columns" if None in row else "the hour has no name")
    numbers: dict[str, float] = {}
    for name, (low, high) in RANGES.items():
        text = cells.get(name, "")
        if not text:
            continue
        try:
            numbers[name] = float(text)
        except ValueError:
            refuse(str(path), line, f"`{text[:40]}` is no number", name)
        if not low <= numbers[name] <= high:
            refuse(str(path), line, f"must lie between {low:g} and {high:g}, not {text[:40]}", name)
    wind = common.wind
    if WIND_SPEED in numbers and (WIND_FROM in numbers or not numbers[WIND_SPEED]):
        wind = Wind(numbers[WIND_SPEED], numbers.get(WIND_FROM, 0.0))
    elif WIND_SPEED in numbers or WIND_FROM in numbers:
        refuse(str(path), line, f"a wind has both `{WIND_FROM}` and `{WIND_SPEED}`")
    qnh, temperature = numbers.get(QNH, common.qnh), numbers.get(TEMPERATURE, common.temperature)
    return Weather(cells["hour"], wind, qnh, temperature)
