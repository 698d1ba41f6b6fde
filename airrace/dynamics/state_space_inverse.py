"""The inverse of the linear inner loop: from commanded load factors and roll rate to the control surfaces.

The causal chain deflection -> rate -> angle -> load factor, backwards. With the trim of a steady, not rolling flight,

    n_z_cmd -> alpha_des      q_des = q_Kbar + K_alpha (alpha_des - alpha_A)        q_K' = K_q (q_des - q_K)
    n_y_cmd -> beta_des       r_des = r_Kbar - K_beta (beta_des - beta_A)           r_s' = K_r (r_des - r_s)
    p_cmd                                                                           p_s' = K_p (p_cmd - p_s)

and then the deflections that make these accelerations. The surfaces' own forces turn the flight path, too: `q_Kbar` and
`r_Kbar` are linear in them, so that the equations remain linear, one for the elevator, two for ailerons and rudder.
"""

from dataclasses import dataclass

from airrace.dynamics.inner_loop_parameters import InnerLoopParameters
from airrace.dynamics.linear_derivatives import LateralMotion, Pair, pitching
from airrace.dynamics.linear_flight import (
    Deflections,
    LinearFlightState,
    Surrounding,
    lateral_load_factor,
    lateral_matrices,
    normal_load_factor,
)
from airrace.dynamics.outer_loop import turn_rates
from airrace.environment.atmosphere import g0
from airrace.frames import Scalar


@dataclass(frozen=True)
class Gains:
    """Bandwidths of the chain's links, 1/s."""

    alpha: float = 6.0
    q: float = 12.0
    p: float = 12.0
    r: float = 8.0
    beta: float = 3.0


GAINS = Gains()


@dataclass(frozen=True)
class Commands:
    """Load factors (g) and roll rate (rad/s) to be flown."""

    n_z: Scalar
    n_y: Scalar
    p: Scalar


def deflections(
    state: LinearFlightState[Scalar],
    commands: Commands,
    here: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
    gains: Gains = GAINS,
) -> Deflections:
    """The deflections (rad) that bring the load factors and the roll rate to what is commanded."""
    eta = elevator(state, commands.n_z, here, aircraft, gains)
    C_L = normal_load_factor(state, eta, here, aircraft)[1]
    lateral = lateral_matrices(state, C_L, here, aircraft)
    xi, zeta = ailerons_and_rudder(state, commands, lateral, here, aircraft, gains)
    return Deflections(eta, xi, zeta)


def angle_of_attack(
    n_z: Scalar, state: LinearFlightState[Scalar], here: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> Scalar:
    """`alpha_A` (rad) at which a steady pull makes the load factor, its pitch rate and elevator included."""
    q_trim = turn_rates(state.V_K, here.R, n_y=0.0, n_z=n_z)[0] * aircraft.cbar / (2.0 * here.flow.V_A)
    # the elevator that trims: eta = -(C_m0 + C_malpha alpha + C_mq q*) / C_meta
    lift_per_moment = aircraft.C_Leta / aircraft.C_meta
    C_L_rest = aircraft.C_L0 + aircraft.C_Lq * q_trim - lift_per_moment * (aircraft.C_m0 + aircraft.C_mq * q_trim)
    slope = here.load * (aircraft.C_Lalpha - lift_per_moment * aircraft.C_malpha) + here.pull
    return (n_z - here.load * C_L_rest) / slope


def elevator(
    state: LinearFlightState[Scalar],
    n_z_cmd: Scalar,
    here: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
    gains: Gains = GAINS,
) -> Scalar:
    """`eta` (rad) for the commanded load factor."""
    M = pitching(here.flow.V_A, here.rho, aircraft)
    n_z_neutral = normal_load_factor(state, 0.0, here, aircraft)[0]
    q_Kbar = turn_rates(state.V_K, here.R, n_y=0.0, n_z=n_z_neutral)[0]
    q_Kbar_eta = g0 * here.load * aircraft.C_Leta / state.V_K
    error = angle_of_attack(n_z_cmd, state, here, aircraft) - here.seen.alpha_A
    wanted = gains.q * (q_Kbar + gains.alpha * error - state.q_K)
    present = M.zero + M.alpha * here.seen.alpha_A + M.q * state.q_K + M.alphadot * (state.q_K - q_Kbar)
    return (wanted - present) / (M.eta - (M.alphadot + gains.q) * q_Kbar_eta)


def sideslip(
    n_y: Scalar,
    state: LinearFlightState[Scalar],
    lateral: LateralMotion,
    here: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
) -> Scalar:
    """`beta_A` (rad) at which a steady flight that does not roll makes the lateral load factor, trimmed."""
    r_trim = turn_rates(state.V_K, here.R, n_y=n_y, n_z=0.0)[1]

    def trimmed(beta_A: float, r_s: Scalar) -> Scalar:
        roll, yaw = lateral.accelerations(beta_A, (0.0, r_s), (0.0, 0.0))
        surfaces = solve(lateral.xi, lateral.zeta, (-roll, -yaw))
        return lateral_load_factor(beta_A, (0.0, r_s), surfaces, state.alpha_K, here, aircraft)

    return (n_y - trimmed(0.0, r_trim)) / trimmed(1.0, 0.0)


def ailerons_and_rudder(
    state: LinearFlightState[Scalar],
    commands: Commands,
    lateral: LateralMotion,
    here: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
    gains: Gains = GAINS,
) -> Pair:
    """`(xi, zeta)` (rad) for the commanded lateral load factor and roll rate."""
    beta_A, rates, neutral = here.seen.beta_A, (state.p_s, state.r_s), (0.0, 0.0)
    n_y_neutral = lateral_load_factor(beta_A, rates, neutral, state.alpha_K, here, aircraft)
    r_Kbar = turn_rates(state.V_K, here.R, n_y=n_y_neutral, n_z=0.0)[1]
    turn = g0 * here.load / state.V_K  # r_Kbar per unit of C_Y
    error = sideslip(commands.n_y, state, lateral, here, aircraft) - beta_A
    roll, yaw = lateral.accelerations(beta_A, rates, neutral)
    wanted_roll = gains.p * (commands.p - state.p_s)
    wanted_yaw = gains.r * (r_Kbar - gains.beta * error - state.r_s)
    return solve(
        (lateral.xi[0], lateral.xi[1] - gains.r * turn * aircraft.C_Yxi),
        (lateral.zeta[0], lateral.zeta[1] - gains.r * turn * aircraft.C_Yzeta),
        (wanted_roll - roll, wanted_yaw - yaw),
    )


def solve(one: Pair, other: Pair, right: Pair) -> Pair:
    """`(a, b)` with `a one + b other = right`."""
    determinant = one[0] * other[1] - other[0] * one[1]
    return (
        (right[0] * other[1] - other[0] * right[1]) / determinant,
        (one[0] * right[1] - right[0] * one[1]) / determinant,
    )
