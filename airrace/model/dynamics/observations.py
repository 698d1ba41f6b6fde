"""The quantities observed of a flight: at a crossing, in a settled flight, its airspeed, and all along a leg.

At a gate or pylon, equations (13) and (14), they are position, wing tips, bank, climb and course. Let `e` be the
path's direction (first column of `R_OKbar`), `y_B` the right wing (`frames.right_wing`), `a` the axis and `l` the
direction to its right (both horizontal), and `d` the horizontal position relative to the centre. Bank, climb and course
are those of the path; they appear only as products of R's entries, which have no jumps; `mu_0` is the prescribed bank:

    bank_sine = cos(gamma) sin(mu - mu_0),   bank_cosine = cos(gamma) cos(mu - mu_0)

A tolerance `|mu - mu_0| <= t` below 90 degrees is `bank_excess_right, bank_excess_left <= 0` with `bank_tan = tan(t)`;
the horizontal angle between path and axis is limited likewise through `course_excess_right` and `course_excess_left`.

Settled, the aircraft flies as in a steady flight with the load factor and the roll rate that it has: no side force, and
the rates of the states that a model calls `at_rest` are zero. These are as many conditions as leave load factor and
roll rate free; commands are then equal to what they command, and deflections balance the moments:

    point mass               n_y = 0
    transfer functions       n_y = 0,   (n_z, n_z_dot, n_y, n_y_dot, p_Kbar)' = 0
    the others               n_y = 0,   (alpha_K, beta_K, p, q, r)' = 0

The exact distance from a crowd has edges and corners that a solver cannot digest. Its stand-in takes, for the nearest
edge and for the foot of the perpendicular on it,

    smooth_minimum(a, b) = (a + b - sqrt((a - b)^2 + w^2)) / 2      (never larger than the minimum)
    smooth_clip(s; 0, L) = (L + sqrt(s^2 + w^2) - sqrt((s - L)^2 + w^2)) / 2

with widths w that are small parts of the required distance, so that it is wrong by less than two thousandths of that.
Over ground, the distance from an area is negative within it, so that there is a way out. In space (16)

    d = sqrt(max(d_ground, 0)^2 + (h - h_crowd)^2)

The room between a wing and a pylon when it is abeam of that is seen from a moment shortly before or after. A wing that
crosses the line between two pylons askew is abeam of one of them some hundredths of a second before, and of the other
one after. With the position `c`, velocity `v`, acceleration `a` and half wing `w` of the moment, the pylon at
`P` is abeam where `(P - c(t)) . v(t) = 0`, all horizontal, on `c(t) = c + v t + a t^2 / 2`; three Newton steps from
zero find it. With the normal `n` to the right of the path there, and `w(t) = w + w' t + w" t^2 / 2` as long as `w`,

    n . (P - c(t)) -+ n . w(t)

is how far to the right of either wing tip the pylon stands, across the track. Of `w"` only the roll acceleration that a
flight was measured to have is known. Left out are terms of order t^3 and what else the attitude has of order t^2. Rates
are those with all controls at zero, on which neither `a` nor `w'` depends.
"""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from airrace.model.dynamics.aerodynamics import wind_airflow
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.elementary import atan2, cos, maximum, minimum, sin, smooth_clip, smooth_maximum, sqrt
from airrace.model.environment import (
    Air,
    AtmosphereParameters,
    WindField,
    atmosphere_parameters,
    calibrated_airspeed,
    density,
    g0,
    pressure,
)
from airrace.model.frames import QUATERNION, right_wing, rotation
from airrace.model.track.course import Crowd, CrowdShape
from airrace.model.track.element import GateOutput
from airrace.model.track.polygons import Point, area
from airrace.optimal_control.quantities import Quantity, Scalar, T, Vector, quantity, vector
from airrace.optimal_control.system import Observation, System, column, named_symbols

NORMAL_BLEND = 1e-6
"""A small number (1) that keeps the horizontal normal of the path defined where the path is vertical."""
VERTICAL_BLEND = 1e-3
"""The angle from the vertical within which the climb angle, which has an edge there, is rounded off, rad."""
CLIP_WIDTH = 0.02
"""The width of the smooth clip, as a part of the required distance (1)."""
EDGE_BLEND = 1e-6
"""A length that keeps the distance from an edge differentiable on the edge, m."""


Symbols = Mapping[str, Scalar]


def _observation(
    name: str, quantities: Sequence[Quantity], x: Symbols, parameters: Sequence[Quantity], b: Symbols, values: ca.SX
) -> Observation:
    arguments = [column(x.values()), column(b.values())]
    function = ca.Function(name.partition(" ")[0], arguments, [values], {"cse": True})
    return Observation(name, tuple(quantities), tuple(parameters), function)


# A crossing.


@vector
class CrossingParameters(Vector[T]):
    """The place of a crossing, and the attitude and course that it is measured against."""

    centre_north: T = quantity("m", scale=100.0, text="centre of the gate, or the pylon, north of the origin")
    centre_east: T = quantity("m", scale=100.0, text="centre of the gate, or the pylon, east of the origin")
    axis_north: T = quantity("1", text="cosine of the axis' heading")
    axis_east: T = quantity("1", text="sine of the axis' heading")
    bank_cos: T = quantity("1", text="cosine of the prescribed bank")
    bank_sin: T = quantity("1", text="sine of the prescribed bank")
    bank_tan: T = quantity("1", text="tangent of the tolerance of the bank")
    crossing_tan: T = quantity("1", text="tangent of the largest angle between path and axis")
    half_span: T = quantity("m", text="distance from the aircraft's centre to a wing tip")


@vector
class CrossingValues(Vector[T]):
    """The quantities observed at a crossing."""

    along: T = quantity("m", scale=100.0, text="position along the axis")
    right: T = quantity("m", scale=100.0, text="position to the right of the axis")
    height: T = quantity("m", scale=100.0, text="height above the origin")
    right_wing: T = quantity("m", scale=100.0, text="right wing tip to the right of the axis")
    left_wing: T = quantity("m", scale=100.0, text="left wing tip to the right of the axis")
    beside_right: T = quantity("m", scale=100.0, text="right wing tip to the right of the centre, across the track")
    beside_left: T = quantity("m", scale=100.0, text="left wing tip to the right of the centre, across the track")
    bank_sine: T = quantity("1", text="sine of the excess bank times cosine of the climb angle")
    bank_cosine: T = quantity("1", text="cosine of the excess bank times cosine of the climb angle")
    bank_excess_right: T = quantity("1", text="positive where the bank exceeds its tolerance to the right")
    bank_excess_left: T = quantity("1", text="positive where the bank exceeds its tolerance to the left")
    climb_sine: T = quantity("1", text="sine of the climb angle")
    course_sine: T = quantity("1", text="component of the path's direction to the right of the axis")
    course_cosine: T = quantity("1", text="component of the path's direction along the axis")
    course_excess_right: T = quantity("1", text="positive where the course exceeds its tolerance to the right")
    course_excess_left: T = quantity("1", text="positive where the course exceeds its tolerance to the left")
    speed: T = quantity("m/s", scale=50.0, text="kinematic speed")
    attitude_norm: T = quantity("1", text="squared length of the attitude quaternion")


def crossing_observation(states: Sequence[Quantity]) -> Observation:
    """Return the observation of a crossing for a model whose states include `x, y, z, V_K, q0, q1, q2, q3`.

    Of a model with a body they include `beta_K`, too.
    """
    x, b = named_symbols(states), named_symbols(CrossingParameters.quantities())
    q = [x[name] for name in QUATERNION]
    position, beta_K = (x["x"], x["y"], x["z"]), x.get("beta_K", 0.0)
    values = crossing_values(position, x["V_K"], q, CrossingParameters(**b), beta_K)
    declared = CrossingValues.quantities(), x, CrossingParameters.quantities(), b
    return _observation("crossing", *declared, column(values.join()))


@functools.lru_cache(maxsize=64)
def with_output(crossing: Observation, output: GateOutput | None) -> Observation:
    """Return the crossing together with the outputs of a kind of element.

    Equal arguments give one and the same object, so that all elements of a kind share it. Quantities and parameters of
    the output come last.

    Raises:
        ValueError: a quantity of the output has the name of one of the crossing.
    """
    if output is None:
        return crossing
    x = ca.SX.sym("x", crossing.values.size1_in(0))
    b, own = named_symbols(crossing.parameters), named_symbols(output.parameters)
    outputs = crossing.values(x, column(b.values()))
    by_name = {quantity.name: outputs[row] for row, quantity in enumerate(crossing.quantities)}
    if twice := by_name.keys() & {quantity.name for quantity in output.quantities}:
        raise ValueError(f"{output.name} outputs {', '.join(sorted(twice))}, which every crossing has")
    values = column([*outputs.elements(), *output.values(by_name, {**b, **own})])
    return Observation(
        name=f"{crossing.name} and {output.name}",
        quantities=(*crossing.quantities, *output.quantities),
        parameters=(*crossing.parameters, *output.parameters),
        values=ca.Function("seen", [x, column([*b.values(), *own.values()])], [values], {"cse": True}),
    )


def crossing_values(
    position: tuple[Scalar, Scalar, Scalar],
    V_K: Scalar,
    q: Sequence[Scalar],
    place: CrossingParameters[Scalar],
    beta_K: Scalar = 0.0,
) -> CrossingValues[Scalar]:
    """Return the quantities observed at one instant.

    Args:
        position: `(x, y, z)` in O, m.
        V_K: kinematic speed, m/s.
        q: attitude of Kbar, scalar first.
        place: the gate or pylon.
        beta_K: kinematic sideslip of the body, rad; zero for models without angles.
    """
    R = rotation(q)
    e_N, e_E, e_D = R[0][0], R[1][0], R[2][0]
    d = (position[0] - place.centre_north, position[1] - place.centre_east)
    right = right_wing(R, sin(beta_K), cos(beta_K))
    wing = (place.half_span * right[0], place.half_span * right[1])
    right_tip = (d[0] + wing[0], d[1] + wing[1])
    left_tip = (d[0] - wing[0], d[1] - wing[1])
    axis = (place.axis_north, place.axis_east)
    to_right = (-place.axis_east, place.axis_north)
    level = sqrt(e_N * e_N + e_E * e_E + NORMAL_BLEND)
    normal = (-e_E / level, e_N / level)
    bank_sine = R[2][1] * place.bank_cos - R[2][2] * place.bank_sin
    bank_cosine = R[2][2] * place.bank_cos + R[2][1] * place.bank_sin
    course_sine, course_cosine = _dot((e_N, e_E), to_right), _dot((e_N, e_E), axis)
    return CrossingValues(
        along=_dot(axis, d),
        right=_dot(to_right, d),
        height=-position[2],
        right_wing=_dot(to_right, right_tip),
        left_wing=_dot(to_right, left_tip),
        beside_right=_dot(normal, right_tip),
        beside_left=_dot(normal, left_tip),
        bank_sine=bank_sine,
        bank_cosine=bank_cosine,
        bank_excess_right=bank_sine - place.bank_tan * bank_cosine,
        bank_excess_left=-bank_sine - place.bank_tan * bank_cosine,
        climb_sine=-e_D,
        course_sine=course_sine,
        course_cosine=course_cosine,
        course_excess_right=course_sine - place.crossing_tan * course_cosine,
        course_excess_left=-course_sine - place.crossing_tan * course_cosine,
        speed=V_K,
        attitude_norm=sum(component * component for component in q),
    )


Place = tuple[Scalar, Scalar]
"""A position over ground, or a direction: north and east, m."""


def _dot(left: Place, right: Place) -> Scalar:
    return left[0] * right[0] + left[1] * right[1]


# A settled flight.

SIDE_ACCELERATION = Quantity("side_acceleration", "m/s2", text="side force on the aircraft over its mass")


def settled_observation(model: FlightModel) -> Observation:
    """Return the observation of the quantities that are zero in a settled flight of a model.

    The numbers of the model are its parameters. Rates are those with all controls at zero, which drive none of the
    states at rest directly.
    """
    system = model.system
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    arguments = column(x.values()), column([0.0] * len(system.controls)), column(p.values())
    rates = dict(zip(x, system.rates(*arguments).elements(), strict=True))
    n_y: Scalar = x.get("n_y")
    if n_y is None:
        assert system.path_values is not None  # models with angles have load factors among their path quantities
        row = [quantity.name for quantity in system.path].index("n_y")
        n_y = system.path_values(*arguments).elements()[row]
    declared = [_rate(state) for name in model.at_rest for state in system.states if state.name == name]
    values = column([g0 * n_y, *(rates[name] for name in model.at_rest)])
    return _observation("settled", [SIDE_ACCELERATION, *declared], x, system.parameters, p, values)


def _rate(state: Quantity) -> Quantity:
    """Return the declaration of a state's rate.

    Its scale is at most 1, for the solver's tolerance is in units of the scale.
    """
    before, per, seconds = state.unit.partition("/s")
    return Quantity(
        f"{state.name}_rate",
        f"{before}/s{int(seconds or 1) + 1 if per else ''}",
        scale=min(1.0, state.scale),
        text=f"rate of change of {state.name}, zero in a settled flight",
        rate_of=state.name,
    )


# A straight line on the ground, and the climb angle.


@vector
class LineParameters(Vector[T]):
    """The parameters of a straight line on the ground.

    `normal . position - offset` is the distance to one side of it.
    """

    normal_north: T = quantity("1", text="direction to the side that counts as positive")
    normal_east: T = quantity("1", text="direction to the side that counts as positive")
    offset: T = quantity("m", scale=100.0, text="distance of the line from the origin")


BESIDE = Quantity("beside", "m", scale=100.0, text="distance from the line, to the allowed side")
CLIMB = Quantity("climb", "rad", text="climb angle")


def line_observation(states: Sequence[Quantity]) -> Observation:
    """Return the observation of the distance from a line for a model whose states include `x, y`."""
    x, b = named_symbols(states), named_symbols(LineParameters.quantities())
    beside = b["normal_north"] * x["x"] + b["normal_east"] * x["y"] - b["offset"]
    return _observation("line", [BESIDE], x, LineParameters.quantities(), b, beside)


def line_values(start: Point, end: Point, *, right: bool) -> tuple[float, ...]:
    """Return the parameters of the line through two points; positive to its right or left, seen from start to end."""
    along = (end.north - start.north, end.east - start.east)
    length = math.hypot(*along)
    sign = 1.0 if right else -1.0
    north, east = -sign * along[1] / length, sign * along[0] / length
    return (north, east, north * start.north + east * start.east)


def climb_observation(states: Sequence[Quantity], *, exact: bool) -> Observation:
    """Return the observation of the climb angle for a model whose states include the attitude `q0 ... q3`."""
    x = named_symbols(states)
    R = rotation([x[name] for name in QUATERNION])
    level = R[0][0] * R[0][0] + R[1][0] * R[1][0]
    climb = atan2(-R[2][0], sqrt(level if exact else level + VERTICAL_BLEND * VERTICAL_BLEND))
    return _observation("climb exact" if exact else "climb", [CLIMB], x, (), {}, climb)


# The distance from a crowd.

DISTANCE = Quantity("distance", "m", scale=100.0, text="distance from the crowd")


@dataclass(frozen=True)
class CrowdKind:
    """The structure of a crowd's distance: everything that shapes its equations but the numbers."""

    shape: CrowdShape
    corners: int
    slant: bool

    @classmethod
    def from_crowd(cls, crowd: Crowd) -> "CrowdKind":
        """Return the kind of a crowd."""
        return cls(crowd.shape, len(crowd.corners), crowd.slant)

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """The height, the required distance (which smoothing is relative to), then north and east of each corner."""
        corners = [Quantity(f"{axis}_{number}", "m") for number in range(self.corners) for axis in ("north", "east")]
        return (Quantity("height", "m"), Quantity("keep", "m"), *corners)


def crowd_values(crowd: Crowd) -> tuple[float, ...]:
    """Return the values of `CrowdKind.parameters`; the corners of an area run clockwise."""
    corners = list(crowd.corners)
    if crowd.shape is CrowdShape.AREA and area(corners) < 0.0:
        corners.reverse()
    places = (coordinate for corner in corners for coordinate in (corner.north, corner.east))
    return (crowd.height, max(crowd.distance, 0.1), *places)  # widths are relative to it


def crowd_observation(states: Sequence[Quantity], kind: CrowdKind, *, exact: bool) -> Observation:
    """Return the observation of the distance from a crowd for a model whose states include `x, y, z`."""
    x, b = named_symbols(states), named_symbols(kind.parameters)
    height, keep, *corner_values = b.values()
    corners = list(zip(corner_values[::2], corner_values[1::2], strict=True))
    width = None if exact else keep
    distance = _ground_distance(kind.shape, (x["x"], x["y"]), corners, width)
    if kind.slant:
        above = -x["z"] - height
        if kind.shape is CrowdShape.AREA:
            distance = maximum(distance, 0.0) if exact else smooth_maximum(distance, 0.0, CLIP_WIDTH * keep)
        distance = sqrt(distance * distance + above * above)
    name = f"crowd {kind.shape.value} {kind.corners} {'slant' if kind.slant else 'ground'}{' exact' if exact else ''}"
    return _observation(name, [DISTANCE], x, kind.parameters, b, distance)


# The distance `keep` that the widths of the rounding are relative to is None where nothing is rounded.


def _ground_distance(shape: CrowdShape, place: Place, corners: Sequence[Place], keep: Scalar | None) -> Scalar:
    """Return the distance over ground, m; within an area it is the distance from its border, negative."""
    if shape is CrowdShape.POINT:
        return _length(place[0] - corners[0][0], place[1] - corners[0][1], keep)
    following = [*corners[1:], corners[0]] if shape is CrowdShape.AREA else corners[1:]
    sides = list(zip(corners, following, strict=False))
    nearest, *further = [_edge_distance(place, a, b, keep) for a, b in sides]
    for distance in further:
        width = None if keep is None else 0.002 * keep  # the width of the smooth minimum relative to the distance
        nearest = minimum(nearest, distance) if width is None else -smooth_maximum(-nearest, -distance, width)
    return nearest if shape is CrowdShape.LINE else nearest * (1.0 - 2.0 * _winding(place, sides))


def _edge_distance(place: Place, a: Place, b: Place, keep: Scalar | None) -> Scalar:
    along = (b[0] - a[0], b[1] - a[1])
    length = sqrt(along[0] * along[0] + along[1] * along[1])
    offset = (place[0] - a[0], place[1] - a[1])
    foot = (offset[0] * along[0] + offset[1] * along[1]) / length
    width = None if keep is None else CLIP_WIDTH * keep
    foot = minimum(maximum(foot, 0.0), length) if width is None else smooth_clip(foot, 0.0, length, width)
    return _length(offset[0] - foot * along[0] / length, offset[1] - foot * along[1] / length, keep)


def _length(north: Scalar, east: Scalar, keep: Scalar | None) -> Scalar:
    squared = north * north + east * east
    return sqrt(squared if keep is None else squared + EDGE_BLEND * EDGE_BLEND)


def _winding(place: Place, sides: Sequence[tuple[Place, Place]]) -> Scalar:
    """Return how often a border that runs clockwise winds around a place: 1 within, 0 outside.

    The angles under which the sides are seen add up to a full turn or to nothing; so do their derivatives, to nothing.
    """
    turn: Scalar = 0.0
    for a, b in sides:
        to_a, to_b = (a[0] - place[0], a[1] - place[1]), (b[0] - place[0], b[1] - place[1])
        turn += atan2(to_a[0] * to_b[1] - to_a[1] * to_b[0], to_a[0] * to_b[0] + to_a[1] * to_b[1])
    return turn / (2.0 * math.pi)


AIRSPEED = Quantity("airspeed", "m/s", scale=50.0, text="airspeed")


@functools.lru_cache(maxsize=32)
def airspeed_observation(states: tuple[Quantity, ...], field: WindField, *, indicated: bool) -> Observation:
    """Return the observation for a model whose states include `x, y, z, V_K, q0, q1, q2, q3`.

    Its parameters are those of the atmosphere and of the wind, see `airspeed_values`.
    """
    declared = (*AtmosphereParameters.quantities(), *field.parameters)
    x, b = named_symbols(states), named_symbols(declared)
    numbers = list(b.values())
    air = AtmosphereParameters[Scalar].split(numbers[: AtmosphereParameters.size()])
    wind = field.velocity(x["x"], x["y"], x["z"], numbers[AtmosphereParameters.size() :])
    V_A = wind_airflow(x["V_K"], rotation([x[name] for name in QUATERNION]), wind).V_A
    speed = calibrated_airspeed(V_A, pressure(x["z"], air), density(x["z"], air)) if indicated else V_A
    function = ca.Function("airspeed", [column(x.values()), column(numbers)], [column([speed])], {"cse": True})
    return Observation("airspeed", (AIRSPEED,), declared, function)


def airspeed_values(air: Air) -> tuple[float, ...]:
    """Return the values of the parameters of `airspeed_observation` in the air of a day."""
    return (*atmosphere_parameters(air).join(), *WindField.from_air(air).values(air))


LEVEL_BLEND = 1e-2
"""A squared speed (m2/s2) that keeps the normal of the path defined where the path is vertical."""


@vector
class PylonParameters(Vector[T]):
    """A pylon, and the wing."""

    north: T = quantity("m", scale=100.0, text="pylon, north of the origin")
    east: T = quantity("m", scale=100.0, text="pylon, east of the origin")
    top: T = quantity("m", scale=100.0, text="top of the pylon above the origin")
    semispan: T = quantity("m", text="distance from the aircraft's centre to a wing tip")
    roll_acceleration: T = quantity("rad/s2", scale=10.0, text="acceleration of the right wing tip down, as measured")


@vector
class PylonRoom(Vector[T]):
    """Where the pylon is as seen from either wing tip, when that passes it abeam, and how fast the wing rolls now."""

    left_tip: T = quantity("m", scale=100.0, text="pylon to the right of the left wing tip, when that is abeam")
    right_tip: T = quantity("m", scale=100.0, text="pylon to the right of the right wing tip, when that is abeam")
    above_left: T = quantity("m", scale=100.0, text="left wing tip above the top of the pylon, when that is abeam")
    above_right: T = quantity("m", scale=100.0, text="right wing tip above the top of the pylon, when that is abeam")
    roll_rate: T = quantity("rad/s", text="rate at which the right wing goes down about the path")


@functools.lru_cache(maxsize=32)
def pylon_room_observation(system: System) -> Observation:
    """Return the observation of the room for a model; its parameters are the pylon, then the numbers of the model."""
    x, p = named_symbols(system.states), named_symbols(system.parameters)
    b = named_symbols(PylonParameters.quantities())
    states, numbers = column(x.values()), column(p.values())
    rates = system.rates(states, column([0.0] * len(system.controls)), numbers)
    R = rotation([x[name] for name in QUATERNION])
    beta: Scalar = x.get("beta_K", 0.0)
    right = right_wing(R, sin(beta), cos(beta))
    bend = [b["roll_acceleration"] * R[row][2] for row in range(3)]
    velocity = [x["V_K"] * R[row][0] for row in range(3)]
    change: list[Scalar] = [*ca.jtimes(column([*velocity, *right]), states, rates).elements()]
    acceleration, turning = change[:3], change[3:]
    way = [b["north"] - x["x"], b["east"] - x["y"], -b["top"] - x["z"]]

    def tip(side: float) -> tuple[Scalar, Scalar]:
        """Return the way from a wing tip to the pylon, to the right, and its height above the top, when it is abeam."""

        def ahead(t: Scalar) -> tuple[list[Scalar], list[Scalar]]:
            """Return the way from the tip to the top of the pylon, and the velocity of the tip, at a time."""
            wing = [w + rate * t + 0.5 * bent * t * t for w, rate, bent in zip(right, turning, bend, strict=True)]
            rates = [rate + bent * t for rate, bent in zip(turning, bend, strict=True)]
            half = side * b["semispan"] / sqrt(sum(component * component for component in wing))
            rows = list(zip(way, velocity, acceleration, wing, rates, strict=True))
            return [d - v * t - 0.5 * a * t * t - half * w for d, v, a, w, _ in rows], [
                v + a * t + half * rate for _, v, a, _, rate in rows
            ]

        t: Scalar = ca.SX(0.0)
        for _ in range(3):
            d, v = ahead(t)
            slope = v[0] ** 2 + v[1] ** 2 - d[0] * acceleration[0] - d[1] * acceleration[1] + LEVEL_BLEND
            t = t + (d[0] * v[0] + d[1] * v[1]) / slope
        d, v = ahead(t)
        return (v[0] * d[1] - v[1] * d[0]) / sqrt(v[0] ** 2 + v[1] ** 2 + LEVEL_BLEND), d[2]

    (left_tip, above_left), (right_tip, above_right) = tip(-1.0), tip(1.0)
    roll_rate: Scalar = sum(rate * R[row][2] for row, rate in enumerate(turning))
    rooms = PylonRoom(
        left_tip=left_tip,
        right_tip=right_tip,
        above_left=above_left,
        above_right=above_right,
        roll_rate=roll_rate,
    )
    parameters: Sequence[Quantity] = (*PylonParameters.quantities(), *system.parameters)
    values = column(rooms.join())
    function = ca.Function("pylon_room", [states, column([*b.values(), *p.values()])], [values], {"cse": True})
    return Observation("pylon room", PylonRoom.quantities(), tuple(parameters), function)
