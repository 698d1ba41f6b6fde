"""The handling of an aircraft, in the terms of its designers and pilots.

A fault leaves a command without a solution, so no controller can help it. A remark is a weakness that may show in a
race.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from airrace.model.aircraft import Aircraft, InnerLoopParameters, inner_loop_parameters
from airrace.model.dynamics.limits import linear_range
from airrace.model.dynamics.rigid_body import lateral_motion, level_lags, linear_parameters, pitching
from airrace.model.dynamics.state_space_inversion import Q_BANDWIDTH, solve
from airrace.model.environment import RHO_ISA, g0
from airrace.optimal_control.quantities import Interval

Fault = tuple[str, str, str]
"""A fault: group and key of the aircraft file that is to blame, and what is wrong."""


def faults(aircraft: Aircraft) -> tuple[Fault, ...]:
    """Return why commands could have no solution in the models with an inner loop; empty if they always have one."""
    return (*_elevator_faults(aircraft), *_lateral_faults(aircraft), *_correction_faults(aircraft))


def remarks(aircraft: Aircraft) -> tuple[str, ...]:
    """Return the weaknesses of an aircraft without faults, one sentence each; empty if it has none."""
    return (*_pitch_stability(aircraft), *_control_power(aircraft), *_lateral_stability(aircraft))


def corner_speed(aircraft: Aircraft) -> float:
    """Return the speed (m/s) at which `C_L_max` makes the greatest load factor at sea level, within the envelope."""
    airframe, V = aircraft.airframe, aircraft.envelope.V
    load = aircraft.envelope.n_z.upper * airframe.m * g0
    return min(max(math.sqrt(2.0 * load / (RHO_ISA * airframe.S * aircraft.lift.C_L_max)), V.lower), V.upper)


def _elevator_faults(aircraft: Aircraft) -> Iterator[Fault]:
    lift, pitch, numbers = aircraft.lift, aircraft.pitch, linear_parameters(aircraft)
    if lift.C_Lalpha - lift.C_Leta * numbers.C_malpha / pitch.C_meta <= 0.0:
        yield (
            "pitch",
            "C_meta",
            "no elevator power: trimming a greater angle of attack costs the elevator more lift than the wing gains",
        )
        return
    V = aircraft.envelope.V.lower
    M = pitching(V, RHO_ISA, numbers)
    turn = 0.5 * RHO_ISA * V * numbers.S * numbers.C_Leta / numbers.m  # q_Kbar per rad of elevator
    if M.eta - (M.alphadot + Q_BANDWIDTH) * turn >= 0.0:
        yield (
            "pitch",
            "C_meta",
            f"no elevator power: at {V:g} m/s the lift that it makes undoes what its moment does",
        )


def _lateral_faults(aircraft: Aircraft) -> Iterator[Fault]:
    roll, yaw = aircraft.roll, aircraft.yaw
    own = roll.C_lxi * yaw.C_nzeta
    # Below it the effects of ailerons and rudder cannot be distinguished.
    if own - roll.C_lzeta * yaw.C_nxi <= 1e-3 * own:
        yield (
            "yaw",
            "C_nzeta",
            "ailerons and rudder cannot be distinguished: C_lxi C_nzeta must be above C_lzeta C_nxi, or no pair of "
            "deflections rolls without yawing",
        )
        return
    if trimmed_side_force(inner_loop_parameters(aircraft)) >= 0.0:
        yield (
            "side_force",
            "C_Ybeta",
            "a trimmed sideslip makes no side force: what the rudder adds takes away all that C_Ybeta gives",
        )


def _correction_faults(aircraft: Aircraft) -> Iterator[Fault]:
    modes = aircraft.linear
    if modes is None or modes.short_period is None:
        return
    before, after = inner_loop_parameters(aircraft), linear_parameters(aircraft)
    if after.C_mq >= 0.0:
        M = pitching(modes.V, RHO_ISA, before)
        lift = level_lags(before, modes.V).damping_z + M.q + M.alphadot
        least = lift / (2.0 * modes.short_period.omega)
        yield ("linear", "damping_z", f"the lift alone damps more than that; must be above {least:.3g}")


def trimmed_side_force(aircraft: InnerLoopParameters[float]) -> float:
    """Return `C_Y` per rad of sideslip with ailerons and rudder balancing the rolling and the yawing moment."""
    xi, zeta = sideslip_trim(aircraft)
    return aircraft.C_Ybeta + aircraft.C_Yxi * xi + aircraft.C_Yzeta * zeta


def sideslip_trim(aircraft: InnerLoopParameters[float]) -> tuple[float, float]:
    """Return the deflections `(xi, zeta)` per rad of sideslip that is held without rolling or yawing."""
    return solve(
        (aircraft.C_lxi, aircraft.C_nxi), (aircraft.C_lzeta, aircraft.C_nzeta), (-aircraft.C_lbeta, -aircraft.C_nbeta)
    )


def _pitch_stability(aircraft: Aircraft) -> Iterator[str]:
    lift, pitch, V = aircraft.lift, aircraft.pitch, corner_speed(aircraft)
    if level_lags(inner_loop_parameters(aircraft), V).stiffness_z <= 0.0:
        yield (
            f"unstable in pitch: the centre of gravity lies behind the manoeuvre point (C_malpha = {pitch.C_malpha:g}, "
            "and the damping C_mq does not make up for it)"
        )
    elif pitch.C_malpha >= 0.0:
        yield (
            f"statically unstable in pitch: the centre of gravity lies {100.0 * pitch.C_malpha / lift.C_Lalpha:.1f} % "
            "of the mean chord behind the neutral point, though before the manoeuvre point"
        )


def _control_power(aircraft: Aircraft) -> Iterator[str]:
    """Judge elevator, ailerons and rudder by the lift, the roll rate and the sideslip that they must reach."""
    pitch, airframe, surfaces, V = aircraft.pitch, aircraft.airframe, aircraft.surfaces, corner_speed(aircraft)
    angles = linear_range(aircraft.lift)
    for alpha, name in ((angles.upper, "C_L_max"), (angles.lower, "C_L_min")):
        C_L = getattr(aircraft.lift, name)
        n_z = 0.5 * RHO_ISA * V * V * airframe.S * C_L / (airframe.m * g0)
        q = (n_z - 1.0) * g0 / V * airframe.cbar / (2.0 * V)
        eta = -(pitch.C_m0 + pitch.C_malpha * alpha + pitch.C_mq * q) / pitch.C_meta
        if beyond := _beyond_travel(eta, surfaces.eta):
            yield f"short of elevator: {name} at {V:.0f} m/s takes {beyond}"

    top, roll_rate = aircraft.envelope.V.upper, aircraft.point_mass.p
    p = aircraft.roll.C_lxi / aircraft.roll.C_lp * surfaces.xi.upper * 2.0 * top / airframe.b
    if p < roll_rate:
        yield (
            f"short of ailerons: full deflection rolls at {math.degrees(p):.0f} deg/s at {top:g} m/s, the top of the "
            f"envelope; the roll rate's limit of {math.degrees(roll_rate):.0f} deg/s is out of reach"
        )

    beta = aircraft.drag.beta_A_max
    xi, zeta = (angle * beta for angle in sideslip_trim(inner_loop_parameters(aircraft)))
    for name, deflection, travel in (("rudder", zeta, surfaces.zeta), ("ailerons", xi, surfaces.xi)):
        if beyond := _beyond_travel(deflection, travel):
            yield f"short of {name} in sideslip: holding {math.degrees(beta):.0f} deg of sideslip takes {beyond}"


def _beyond_travel(deflection: float, travel: Interval) -> str:
    """Return how far a deflection is beyond its travel, in words; empty where it is within."""
    if travel.lower <= deflection <= travel.upper:
        return ""
    return f"{abs(math.degrees(deflection)):.0f} deg, the travel ends at {math.degrees(travel.upper):.0f} deg"


def _lateral_stability(aircraft: Aircraft) -> Iterator[str]:
    """Judge stability in level flight, at the first of three speeds that shows an instability."""
    V = aircraft.envelope.V
    for speed in (V.lower, corner_speed(aircraft), V.upper):
        modes = lateral_modes(aircraft, speed)
        worst = modes[int(np.argmax(modes.real))]
        if worst.real <= 0.0:
            continue
        if worst.imag != 0.0:
            yield (
                f"Dutch roll unstable at {speed:.0f} m/s: it doubles every {math.log(2.0) / worst.real:.1f} s, with "
                f"{abs(worst.imag):.1f} rad/s"
            )
        else:
            yield (
                f"unstable in yaw at {speed:.0f} m/s: sideslip doubles every {math.log(2.0) / worst.real:.1f} s "
                f"(C_nbeta = {aircraft.yaw.C_nbeta:g}, C_lbeta = {aircraft.roll.C_lbeta:g})"
            )
        return


def lateral_modes(aircraft: Aircraft, V: float) -> NDArray[np.complex128]:
    """Return the eigenvalues (1/s) of the lateral motion in level flight at `V` (m/s) at sea level; shape (3,).

    The motion is that of sideslip, roll rate and yaw rate with controls fixed.
    """
    numbers = inner_loop_parameters(aircraft)
    load = 0.5 * RHO_ISA * V * V * numbers.S / (numbers.m * g0)
    C_L = 1.0 / load
    alpha = (C_L - numbers.C_L0) / numbers.C_Lalpha
    motion = lateral_motion(V, RHO_ISA, alpha, C_L, numbers)
    turn = (
        g0
        / V
        * load
        * np.array([numbers.C_Ybeta, numbers.C_Yp * numbers.b / (2.0 * V), numbers.C_Yr * numbers.b / (2.0 * V)])
    )
    columns = (motion.beta, motion.p, motion.r)
    matrix = np.array([turn - [0.0, 0.0, 1.0], [column[0] for column in columns], [column[1] for column in columns]])
    return np.linalg.eigvals(matrix).astype(np.complex128)
