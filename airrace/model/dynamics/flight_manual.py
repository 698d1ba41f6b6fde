"""The figures of a flight manual by the equations of flight, and an aircraft from such figures.

The figures are of steady flight at full throttle, ISA at sea level:

    stall       m g0 = rho/2 V_S^2 S C_L_max
    top speed   T(V) = D(V) in level flight, the largest such V
    climb       V sin gamma, m g0 sin gamma = T - D, lift m g0 cos gamma, at the best speed
    roll        C_lxi xi_max + C_lp p b/(2 V) = 0
    turn        T(V) = D(V, n), the largest n that lift, strength and thrust allow, at the best speed

For an aircraft from figures a template is rescaled by relations of textbooks. What a figure determines is solved for,
what geometry determines is scaled, all else stays the template's. The relations are those of B. Etkin & L. D. Reid,
*Dynamics of Flight*, 3rd ed. 1996 (tail volumes, strip theory), D. P. Raymer, *Aircraft Design: A Conceptual Approach*
(Oswald factor, radii of gyration), and Helmbold's lift curve slope.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from airrace.errors import UsageError
from airrace.model.aircraft import Aircraft, AircraftParameters, Envelope, aircraft_parameters
from airrace.model.dynamics.aerodynamics import drag_coefficient, thrust
from airrace.model.environment import RHO_ISA, g0
from airrace.optimal_control.quantities import Interval

FASTEST = 400.0
"""A speed that no aircraft with a propeller reaches in level flight, m/s."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Performance:
    """What an aircraft does in steady flight: speeds and `climb` in m/s, `roll_rate` in rad/s, `turn` in g.

    `speed_max` is 0 where power balances drag at no speed, `turn` likewise. `V_A` is the largest speed at which the
    wing stalls before it is overloaded, at most `speed_max`.
    """

    stall: float
    speed_max: float
    climb: float
    V_A: float
    roll_rate: float
    turn: float


def performance(aircraft: Aircraft, roll_speed: float | None = None) -> Performance:
    """Return all figures of an aircraft, the roll rate at a speed (m/s), by default `V_A`."""
    stall, fastest = stall_speed(aircraft), top_speed(aircraft)
    V_A = min(stall * math.sqrt(aircraft.envelope.n_z.upper), fastest or FASTEST)
    rolls = roll_rate(aircraft, roll_speed or V_A)
    return Performance(stall, fastest, climb_rate(aircraft), V_A, rolls, sustained_load_factor(aircraft))


def under(aircraft: Aircraft, mass: float | None, power: float | None) -> Aircraft:
    """Return an aircraft with another mass (kg) and power (W); None leaves its own."""
    airframe, engine = aircraft.airframe, aircraft.propulsion
    return replace(
        aircraft,
        airframe=replace(airframe, m=mass or airframe.m),
        propulsion=replace(engine, P_max=power or engine.P_max),
    )


def stall_speed(aircraft: Aircraft) -> float:
    """Return the least speed of level flight, m/s."""
    airframe = aircraft.airframe
    return math.sqrt(2.0 * airframe.m * g0 / (RHO_ISA * airframe.S * aircraft.lift.C_L_max))


def top_speed(aircraft: Aircraft) -> float:
    """Return the largest speed of level flight, m/s; 0 where there is none."""
    numbers, slow = aircraft_parameters(aircraft), _best_climb_speed(aircraft)
    if _climb_rate(numbers, slow) <= 0.0:
        return 0.0
    return bisect(lambda V: full_thrust(numbers, V) - _drag(numbers, V, 1.0), slow, FASTEST)


def climb_rate(aircraft: Aircraft) -> float:
    """Return the best rate of climb, m/s; below zero for an aircraft that cannot fly level."""
    return _climb_rate(aircraft_parameters(aircraft), _best_climb_speed(aircraft))


def roll_rate(aircraft: Aircraft, V: float) -> float:
    """Return the steady roll rate of full ailerons at a speed (m/s), rad/s."""
    roll = aircraft.roll
    return roll.C_lxi / roll.C_lp * aircraft.surfaces.xi.upper * 2.0 * V / aircraft.airframe.b


def sustained_load_factor(aircraft: Aircraft) -> float:
    """Return the largest load factor of a level turn that holds height and speed, g; 0 where there is none."""
    numbers = aircraft_parameters(aircraft)

    def load_factor(V: float) -> float:
        qS = 0.5 * RHO_ISA * V * V * numbers.S
        pull, per_C_L = full_thrust(numbers, V), qS / (numbers.m * g0)
        least, most = per_C_L * numbers.C_L_minD, per_C_L * aircraft.lift.C_L_max
        if pull >= _drag(numbers, V, most):
            return most
        if pull <= _drag(numbers, V, least):
            return 0.0  # no turn holds this speed
        return bisect(lambda n_z: pull - _drag(numbers, V, n_z), least, most)

    best = load_factor(_maximum(load_factor, stall_speed(aircraft), FASTEST))
    return min(best, aircraft.envelope.n_z.upper) if best >= 1.0 else 0.0


def full_thrust(numbers: AircraftParameters[float], V: float) -> float:
    """Return the thrust at full throttle at a speed (m/s), N."""
    return float(thrust(1.0, V, RHO_ISA, numbers))


def bisect(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a function that is positive at `low` and negative at `high`, whichever is larger."""
    for _ in range(50):  # until no digit is left
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _drag(numbers: AircraftParameters[float], V: float, load_factor: float) -> float:
    qS = 0.5 * RHO_ISA * V * V * numbers.S
    return qS * drag_coefficient(load_factor * numbers.m * g0 / qS, 0.0, V, RHO_ISA, numbers)


def _climb_rate(numbers: AircraftParameters[float], V: float) -> float:
    """Return the rate of climb at a speed, m/s: a fixed point, for the induced drag hardly depends on the climb."""
    pull, sine = full_thrust(numbers, V), 0.0
    for _ in range(10):
        sine = (pull - _drag(numbers, V, math.sqrt(1.0 - sine * sine))) / (numbers.m * g0)
        sine = min(max(sine, -1.0), 1.0)
    return V * sine


def _best_climb_speed(aircraft: Aircraft) -> float:
    numbers = aircraft_parameters(aircraft)
    return _maximum(lambda V: _climb_rate(numbers, V), stall_speed(aircraft), FASTEST)


def _maximum(value: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function with one maximum has it, by golden sections."""
    while high - low > 1e-3:
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (left, high) if value(left) < value(right) else (low, right)
    return 0.5 * (low + high)


# The ranges of aircraft with propellers; figures that ask for more contradict each other.
ASPECT_RATIO_RANGE = Interval(2.0, 30.0)
C_L_MAX_RANGE = Interval(0.7, 2.5)  # without flaps
C_D0_RANGE = Interval(0.008, 0.12)
EFFICIENCY_RANGE = Interval(0.4, 0.95)
HELIX_ANGLE_RANGE = Interval(0.01, 0.8)

GIVEN = "given"
"""The relation of a number that the manual itself gives."""

Relations = Mapping[tuple[str, str], str]
"""By group and field of an aircraft: the relation that its number comes from."""


@dataclass(frozen=True)
class ManualFigures:
    """The figures of a flight manual, in SI and rad, at sea level; None where it has none.

    Attributes:
        mass, span, area, power: of the aircraft that flies.
        stall: without flaps; `speed_max`: of level flight; `climb`: the best rate.
        roll_rate, roll_speed: of full ailerons, and where that holds; by default at `V_A`.
        n_z, n_z_min, speed_limit: limits of the load factor, and V_NE.
        turn: load factor of the tightest level turn that is held; it is only compared.
        manual_mass, manual_power: at which the manual's figures hold, where others fly.
    """

    mass: float | None = None
    span: float | None = None
    area: float | None = None
    power: float | None = None
    stall: float | None = None
    speed_max: float | None = None
    climb: float | None = None
    roll_rate: float | None = None
    roll_speed: float | None = None
    n_z: float | None = None
    n_z_min: float | None = None
    speed_limit: float | None = None
    turn: float | None = None
    manual_mass: float | None = None
    manual_power: float | None = None


class Estimation:
    """The template on its way to the aircraft: every step changes numbers and records by which relation."""

    def __init__(self, template: Aircraft, figures: ManualFigures) -> None:
        """Take the template and the figures."""
        self.template, self.figures = template, figures
        self.aircraft = template
        self.relations: dict[tuple[str, str], str] = {}

    def change(self, group: str, relation: str, **values: float) -> None:
        """Replace numbers of a group."""
        self.aircraft = replace(self.aircraft, **{group: replace(getattr(self.aircraft, group), **values)})
        self.relations.update({(group, name): relation for name in values})

    def scale(self, group: str, factor: float, relation: str, *names: str) -> None:
        """Multiply numbers of a group by a factor; numbers that stay are not recorded."""
        values = {name: getattr(getattr(self.aircraft, group), name) for name in names}
        if not math.isclose(factor, 1.0, rel_tol=1e-9):
            self.change(group, relation, **{name: factor * value for name, value in values.items() if value})

    @property
    def by_the_manual(self) -> Aircraft:
        """The aircraft as it is so far, with the mass and power of the manual."""
        return under(self.aircraft, self.figures.manual_mass, self.figures.manual_power)


def estimate(template: Aircraft, figures: ManualFigures, name: str) -> tuple[Aircraft, Relations]:
    """Return the aircraft that has the figures, and where each of its numbers comes from.

    Constants of linear loops are not taken over: they belong to the template.

    Raises:
        UsageError: no aircraft has these figures.
    """
    work = Estimation(replace(template, name=name, linear=None), figures)
    for step in (_geometry, _lift, _propulsion, _envelope, _rolling):
        step(work)
    return work.aircraft, work.relations


def _ensure(value: float, allowed: Interval, text: str, question: str) -> None:
    """Refuse figures that ask for a value which no aircraft has."""
    if not allowed.lower <= value <= allowed.upper:
        raise UsageError(f"{text} {value:.3g}; aircraft have {allowed.lower:.3g} to {allowed.upper:.3g}. {question}")


def _geometry(work: Estimation) -> None:
    """Set mass and size, and what scales with them."""
    figures, old = work.figures, work.template.airframe
    geometry = {"m": figures.mass, "b": figures.span, "S": figures.area}
    work.change("airframe", GIVEN, **{name: value for name, value in geometry.items() if value is not None})
    m, b, S = (getattr(work.aircraft.airframe, name) for name in ("m", "b", "S"))
    A, A_old = b * b / S, old.b**2 / old.S
    text = f"a span of {b:g} m (--span) and an area of {S:g} m2 (--area) make an aspect ratio of"
    _ensure(A, ASPECT_RATIO_RANGE, text, "Which of them is it not?")
    inertia = m * b * b / (old.m * old.b**2)
    work.scale("airframe", inertia, "m b^2, radii of gyration of the template", "I_x", "I_y", "I_z", "I_xz")
    chord = S / b / (old.S / old.b)
    work.scale("airframe", chord, "S/b, shape of the template", "cbar")
    slope = A / (2.0 + math.hypot(2.0, A)) / (A_old / (2.0 + math.hypot(2.0, A_old)))
    work.scale("lift", slope, "Helmbold, 2 pi A/(2 + sqrt(4 + A^2)), section of the template", "C_Lalpha")
    work.scale("drag", A_old / A, "1/(pi e A), Oswald factor e of the template", "k")
    work.scale("roll", slope, "strip theory: as C_Lalpha", "C_lp")
    work.scale("pitch", slope, "static margin of the template: as C_Lalpha", "C_malpha")
    # The tail grows with the wing and its arm with the span, so that tail volumes change as b/cbar.
    arm = b / old.b / chord
    work.scale("lift", arm, "tail volume: as b/cbar", "C_Lq")
    work.scale("pitch", arm, "tail volume: as b/cbar", "C_meta")
    work.scale("pitch", arm * arm, "tail volume and arm: as (b/cbar)^2", "C_mq", "C_malphadot")


def _lift(work: Estimation) -> None:
    """Set the ends of the lift curve by the stall speed."""
    V, airframe, lift = work.figures.stall, work.by_the_manual.airframe, work.template.lift
    if V is None:
        return
    C_L_max = 2.0 * airframe.m * g0 / (RHO_ISA * V * V * airframe.S)
    text = f"a stall at {V:.4g} m/s (--stall) with {airframe.m:g} kg and {airframe.S:g} m2 takes a C_L_max of"
    _ensure(C_L_max, C_L_MAX_RANGE, text, "Is it without flaps, and with this mass (--manual-mass)?")
    work.change("lift", "stall speed: 2 m g0/(rho V_S^2 S)", C_L_max=C_L_max)
    work.change("lift", "in the template's ratio to C_L_max", C_L_min=C_L_max * lift.C_L_min / lift.C_L_max)


def _propulsion(work: Estimation) -> None:
    """Set power, drag and propeller efficiency by top speed and climb."""
    figures, engine = work.figures, work.template.propulsion
    if figures.power is not None:
        work.change("propulsion", GIVEN, P_max=figures.power)
        T_static = engine.T_static * (figures.power / engine.P_max) ** (2.0 / 3.0)
        work.change("propulsion", "momentum theory: as P^(2/3), propeller disc of the template", T_static=T_static)
    V, climb, manual = figures.speed_max, figures.climb, work.by_the_manual
    conditions = f"with {manual.airframe.m:g} kg, {manual.propulsion.P_max / 1000.0:.4g} kW"
    if V is not None and stall_speed(manual) >= V:
        raise UsageError(f"--speed-max {V:.4g} m/s is below the stall, {stall_speed(manual):.4g} m/s")
    if climb is not None:
        ends, top = EFFICIENCY_RANGE, f" and {V:.4g} m/s top speed" if V else ""
        slow, fast = (climb_rate(_with_efficiency(manual, eta, V)) for eta in (ends.lower, ends.upper))
        text = f"{conditions}{top} no propeller makes a climb (--climb) in m/s of"
        _ensure(climb, Interval(slow, fast), text, "At which mass does it hold (--manual-mass)?")
        eta = bisect(lambda eta: climb - climb_rate(_with_efficiency(manual, eta, V)), ends.lower, ends.upper)
        work.change("propulsion", "best rate of climb: m g0 sin(gamma) = T - D", eta_p=eta)
    if V is not None:
        C_D0 = _with_efficiency(manual, work.aircraft.propulsion.eta_p, V).drag.C_D0
        text = f"a top speed of {V:.4g} m/s (--speed-max) {conditions} and {manual.airframe.S:g} m2 takes a C_D0 of"
        _ensure(C_D0, C_D0_RANGE, text, "Is it of level flight at sea level, with this power (--manual-power)?")
        work.change("drag", "top speed: T = D in level flight", C_D0=C_D0)


def _with_efficiency(aircraft: Aircraft, eta: float, V: float | None) -> Aircraft:
    """Return an aircraft with a propeller efficiency, and with the drag of the top speed `V` (m/s) if there is one."""
    aircraft = replace(aircraft, propulsion=replace(aircraft.propulsion, eta_p=eta))
    if V is None:
        return aircraft
    qS = 0.5 * RHO_ISA * V * V * aircraft.airframe.S
    excess = aircraft.airframe.m * g0 / qS - aircraft.drag.C_L_minD
    C_D0 = full_thrust(aircraft_parameters(aircraft), V) / qS - aircraft.drag.k * excess * excess
    return replace(aircraft, drag=replace(aircraft.drag, C_D0=max(C_D0, 1e-4)))


def _envelope(work: Estimation) -> None:
    """Set the limits of load factor and speed."""
    figures, old = work.figures, work.template.envelope
    upper = old.n_z.upper if figures.n_z is None else figures.n_z
    lower = upper * old.n_z.lower / old.n_z.upper if figures.n_z_min is None else figures.n_z_min
    if not top_speed(work.aircraft):
        airframe, kilowatts = work.aircraft.airframe, work.aircraft.propulsion.P_max / 1000.0
        raise UsageError(f"{kilowatts:.4g} kW (--power) carry {airframe.m:g} kg (--mass) in level flight at no speed")
    if figures.speed_limit is not None and figures.speed_limit < (figures.speed_max or 0.0):
        raise UsageError(
            f"--speed-limit {figures.speed_limit:.4g} m/s is below --speed-max {figures.speed_max:.4g} m/s"
        )
    slowest = old.V.lower * stall_speed(work.aircraft) / stall_speed(work.template)
    fastest = figures.speed_limit or old.V.upper * _ratio(top_speed, work)
    work.aircraft = replace(work.aircraft, envelope=Envelope(Interval(slowest, fastest), Interval(lower, upper)))
    by_n_z, by_top = "in the template's ratio to n_z_max", "in the template's ratio to the top speed"
    for key, relation in (
        ("n_z_max", GIVEN if figures.n_z is not None else ""),
        ("n_z_min", GIVEN if figures.n_z_min is not None else by_n_z if figures.n_z is not None else ""),
        ("speed_min_m_s", "in the template's ratio to the stall speed"),
        ("speed_max_m_s", f"{GIVEN}: V_NE" if figures.speed_limit else by_top),
    ):
        work.relations["envelope", key] = relation


def _rolling(work: Estimation) -> None:
    """Set ailerons, and the limits of rolling, by the roll rate."""
    p, V = work.figures.roll_rate, work.figures.roll_speed
    by_ailerons = "in the template's ratio to full ailerons at V_A"
    if p is None:
        work.scale("point_mass", _ratio(lambda candidate: performance(candidate).roll_rate, work), by_ailerons, "p")
    else:
        manual = work.by_the_manual
        fast, speed = V or performance(manual).V_A, f"{V:.1f} m/s" if V else "V_A"
        text = f"{math.degrees(p):.0f} deg/s (--roll-rate) at {fast:.1f} m/s take a helix angle p b/(2 V) of"
        _ensure(p * manual.airframe.b / (2.0 * fast), HELIX_ANGLE_RANGE, text, "Which speed is it (--roll-speed)?")
        factor = p / roll_rate(manual, fast)
        work.scale("roll", factor, f"roll rate at {speed}: C_lp p b/(2 V xi_max)", "C_lxi")
        work.scale("yaw", factor, "adverse yaw: as C_lxi", "C_nxi")
        work.change("point_mass", GIVEN, p=p)
    work.scale("point_mass", _ratio(_roll_acceleration, work), by_ailerons, "p_dot")


def _roll_acceleration(aircraft: Aircraft) -> float:
    """Return the roll acceleration of full ailerons at `V_A`, in proportion."""
    airframe, V = aircraft.airframe, performance(aircraft).V_A
    return V * V * airframe.S * airframe.b * aircraft.roll.C_lxi * aircraft.surfaces.xi.upper / airframe.I_x


def _ratio(figure: Callable[[Aircraft], float], work: Estimation) -> float:
    """Return the ratio of a figure to that of the template; 1 where one of them is zero."""
    new, old = figure(work.aircraft), figure(work.template)
    return new / old if new and old else 1.0
