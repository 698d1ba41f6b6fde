"""States from a stream: JSON lines, NMEA sentences or X-Plane's data output, as states of a flight path.

Velocity and load factor follow from the last positions where they are not sent, and so does the attitude: without
sideslip the lift lies across the path, see `path_histories`. A bank that is sent replaces that.
"""

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from airrace.errors import UsageError
from airrace.flights.logs.histories import path_histories
from airrace.flights.logs.nmea import parse_sentence
from airrace.flights.logs.quality import FixType
from airrace.model.frames import QUATERNION, angles, quaternion, rotation
from airrace.model.track.course import metres
from airrace.race import Race

FOOT = 0.3048
"""A foot, m."""
XPLANE_HEADER = b"DATA"
"""The first bytes of X-Plane's data output: a byte follows, then rows of a number and eight values."""
XPLANE_ROW = struct.Struct("<i8f")
XPLANE_LOAD, XPLANE_ATTITUDE, XPLANE_PLACE, XPLANE_MOTION = 4, 17, 20, 21
"""The rows with the load factor (5th value), with pitch and roll, with latitude, longitude and altitude, and with a
place east, up and south of a local origin and its velocity (4th to 6th value, m/s)."""
XPLANE_TIME = 1
"""The row with times, s: the third value is that of the simulation."""
FASTEST = 300.0
"""The speed beyond which a position has jumped, m/s."""
NEARBY = 30.0
"""The distance that noise may explain, m."""
SECONDS_BETWEEN = 0.04
"""The least time between two states from which a velocity is derived, s."""
GAP_MAX = 0.26
"""The time between two states beyond which nothing is derived from them, s: four a second are enough."""
FIXES_MIN = 3
"""The fixes that a derived velocity and acceleration take."""
FIT_SECONDS = 0.5
"""The time over which coarse places are fitted, s: steps of 0.4 m leave errors of up to 2 m/s."""
LOAD_MAX = 15.0
"""The largest load factor that is believed of a derived acceleration, g."""
JUMPS_MAX = 3
"""The jumps of place or time in a row after which the new ones are believed."""
INCOMPLETE_MAX = 3
"""The times in a row at which sentences lack a height or a speed after which that is told."""
KEYS = "time_s, x_m, y_m, height_m (or latitude_deg, longitude_deg, altitude_m)"


@dataclass(frozen=True)
class Fix:
    """A message: time, s, place north, east and up in the track's frame, m, and what else was sent, SI and radians.

    `velocity` is north, east and up, m/s; None where it was not sent, NaN likewise for the others. `coarse` is a place
    of such large steps that successive ones tell no velocity.
    """

    time: float
    place: tuple[float, float, float]
    velocity: tuple[float, float, float] | None = None
    bank: float = math.nan
    n_z: float = math.nan
    coarse: bool = False


class StreamError(Exception):
    """The error of a message that is no state; its text is for people."""


@dataclass
class StreamReader:
    """The states of one stream, in which each message may need those before it.

    Attributes:
        race: course, aircraft and air.
    """

    race: Race
    _epoch: dict[str, float] = field(default_factory=dict[str, float])
    _settled: bool = False  # the sentences of this time have been answered
    _incomplete: int = 0
    _fixes: list[Fix] = field(default_factory=list[Fix])
    _jumps: int = 0

    def state(self, message: bytes) -> tuple[float, dict[str, float]] | None:
        """Return the time of a message, s, and the state; None where the message alone makes none.

        Raises:
            StreamError: the message is damaged, or its state cannot be true.
        """
        if message.startswith(XPLANE_HEADER):
            fix = self._xplane(message)
        else:
            text = message.decode("utf-8", "replace").strip()
            if not text:
                return None
            fix = self._nmea(text) if text.startswith("$") else self._json(text)
        return None if fix is None else self._state_of(fix)

    def _json(self, text: str) -> Fix:
        try:
            sent = json.loads(text, parse_int=float)  # an integer may have more digits than any float
        except (ValueError, RecursionError):
            raise StreamError(f"no JSON object: {text[:40]!r}; a state has {KEYS}") from None
        if not isinstance(sent, dict):
            raise StreamError(f"no JSON object: {text[:40]!r}; a state has {KEYS}")
        values: dict[str, float] = {}
        for key, value in sent.items():  # pyright: ignore[reportUnknownVariableType]  # whatever was sent
            if isinstance(value, int | float) and not isinstance(value, bool):
                values[str(key)] = float(value)  # pyright: ignore[reportUnknownArgumentType]
        if "time_s" not in values:
            raise StreamError(f"a state without time_s; it has {KEYS}")
        north, east, up = (values.get(name, math.nan) for name in ("north_m_s", "east_m_s", "up_m_s"))
        return Fix(
            values["time_s"],
            self._place(values),
            (north, east, up) if math.isfinite(north + east + up) else None,
            math.radians(values.get("bank_deg", math.nan)),
            values.get("n_z", math.nan),
        )

    def _place(self, values: Mapping[str, float]) -> tuple[float, float, float]:
        if all(name in values for name in ("x_m", "y_m", "height_m")):
            return values["x_m"], values["y_m"], values["height_m"]
        origin = self.race.course.origin
        if not all(name in values for name in ("latitude_deg", "longitude_deg", "altitude_m")):
            raise StreamError(f"a state without a place; it has {KEYS}")
        if not origin.has_coordinates:
            raise UsageError("the stream sends latitudes, and the course has no origin; give one: origin.latitude_deg")
        if not math.isfinite(values["latitude_deg"] + values["longitude_deg"]):
            raise StreamError("a state with a value that is no number")
        latitude, longitude = (np.radians([values[name]]) for name in ("latitude_deg", "longitude_deg"))
        north, east, _ = metres(latitude, longitude, origin)
        return float(north[0]), float(east[0]), values["altitude_m"] - origin.elevation

    def _nmea(self, text: str) -> Fix | None:
        """Return the fix of the sentences GGA (or GNS) and RMC of one time; None for all but the last of them."""
        try:
            time, values = parse_sentence(text)
        except ValueError as error:
            raise StreamError(f"an NMEA sentence that {error}") from None
        if math.isnan(time):
            return None
        missing = ""
        if self._epoch.get("time") != time:
            self._incomplete = self._incomplete + 1 if self._epoch and not self._settled else 0
            if self._incomplete == INCOMPLETE_MAX:
                missing = "GGA or GNS: no height comes" if "V_G" in self._epoch else "RMC"
            self._epoch, self._settled = {"time": time}, False
        if self._settled:
            return None
        self._epoch |= values
        if values.get("fix_type") == FixType.NONE:  # the other sentences of this time repeat an old place
            self._settled = True
            raise StreamError("NMEA without a fix: the receiver has no position")
        if missing:
            raise StreamError(f"NMEA without {missing}; a state takes GGA or GNS, and RMC, of one time")
        if not all(name in self._epoch for name in ("latitude", "altitude", "V_G")):
            return None
        sent, self._settled = self._epoch, True
        latitude, longitude = (math.degrees(sent[name]) for name in ("latitude", "longitude"))
        place = {"latitude_deg": latitude, "longitude_deg": longitude, "altitude_m": sent["altitude"]}
        return Fix(time, self._place(place))  # speeds over ground lack the climb: velocities are derived

    def _xplane(self, message: bytes) -> Fix:
        rows: dict[int, tuple[Any, ...]] = {}  # Any: as `struct` unpacks them
        for offset in range(5, len(message) - XPLANE_ROW.size + 1, XPLANE_ROW.size):
            number, *values = XPLANE_ROW.unpack_from(message, offset)
            rows[number] = tuple(values)
        if XPLANE_PLACE not in rows or XPLANE_TIME not in rows:
            raise StreamError("X-Plane's data output lacks a row; tick 1 (times), 4, 17, 20 and 21 for the network")
        latitude, longitude, feet, *_ = rows[XPLANE_PLACE]
        place = self._place({"latitude_deg": latitude, "longitude_deg": longitude, "altitude_m": FOOT * feet})
        bank = math.radians(rows[XPLANE_ATTITUDE][1]) if XPLANE_ATTITUDE in rows else math.nan
        n_z = rows[XPLANE_LOAD][4] if XPLANE_LOAD in rows else math.nan
        velocity: tuple[float, float, float] | None = None
        if XPLANE_MOTION in rows:
            east, up, south = rows[XPLANE_MOTION][3:6]
            velocity = (-south, east, up)
        # Latitudes have 24 bits.
        return Fix(float(rows[XPLANE_TIME][2]), place, velocity, bank, n_z, coarse=velocity is None)

    def _state_of(self, fix: Fix) -> tuple[float, dict[str, float]] | None:
        if not all(map(math.isfinite, (fix.time, *fix.place))):
            raise StreamError("a state with a value that is no number")
        if self._fixes:
            before = self._fixes[-1]
            passed = fix.time - before.time
            if passed == 0.0:  # a simulator that is paused
                return None
            apart, fault = math.dist(fix.place, before.place), ""
            if passed < 0.0:
                fault = f"a time that does not run forwards: {fix.time:.2f} s after {before.time:.2f} s"
            elif apart > FASTEST * passed + NEARBY:
                fault = f"a jump of {apart:.0f} m in {passed:.2f} s is left out"
            if fault:
                self._jumps += 1
                if self._jumps < JUMPS_MAX:
                    raise StreamError(fault)
                self._fixes = []
            elif passed < SECONDS_BETWEEN and fix.velocity is None:
                return None
        self._jumps = 0
        gap = fix.time - self._fixes[-1].time if self._fixes else 0.0
        recent = [before for before in self._fixes if gap <= GAP_MAX and fix.time - before.time <= FIT_SECONDS + 0.02]
        self._fixes = [*recent, fix]
        motion = self._motion()
        if motion is None:
            if gap > GAP_MAX:
                raise StreamError(f"{gap:.2f} s without a state: velocity and load are derived anew")
            return None
        return fix.time, self._complete(fix, *motion)

    def _motion(self) -> tuple[Any, Any] | None:  # Any: arrays of shape (3,)
        """Return velocity, m/s, and acceleration, m/s^2, at the last fix; None while there are too few."""
        fix = self._fixes[-1]
        if fix.velocity is not None:
            before = self._fixes[-2] if len(self._fixes) > 1 else None
            if before is not None and before.velocity is not None:
                step = max(fix.time - before.time, 1e-3)
                return np.array(fix.velocity), (np.array(fix.velocity) - before.velocity) / step
            is_complete = math.isfinite(fix.bank + fix.n_z)  # nothing follows from the acceleration then
            return (np.array(fix.velocity), np.zeros(3)) if is_complete else None
        fixes = self._fixes if fix.coarse else self._fixes[-FIXES_MIN:]
        span = fix.time - fixes[0].time
        if len(fixes) < FIXES_MIN or (fix.coarse and span < 0.9 * FIT_SECONDS):
            return None
        times = np.array([before.time - fix.time for before in fixes])
        half, velocity, _ = np.polyfit(times, np.array([before.place for before in fixes]), 2)
        return velocity, 2.0 * half

    def _complete(self, fix: Fix, velocity: Any, acceleration: Any) -> dict[str, float]:  # Any: arrays of shape (3,)
        """Return the state of the flight path at a fix."""
        columns = [np.asarray(values, np.float64).reshape(3, 1) for values in (fix.place, velocity, acceleration)]
        histories = path_histories(self.race, columns[0], columns[1], columns[2])
        state = {name: float(histories[name][0]) for name in ("x", "y", "z", "V_K", *QUATERNION, "n_z")}
        state["n_z"] = fix.n_z if math.isfinite(fix.n_z) else min(state["n_z"], LOAD_MAX)
        if math.isfinite(fix.bank):
            chi, gamma, _ = angles(rotation([state[name] for name in QUATERNION]))
            state |= zip(QUATERNION, quaternion(chi, gamma, fix.bank), strict=True)
        return state
