"""The model `state-space-inversion`: linear flight whose control surfaces are moved by a controller.

Its states include the commands. The deflections follow from state and commands at every instant, and their travels are
limits along the path. The controller goes the causal chain deflection -> rate -> angle -> load factor backwards. With
the trim of a steady, not rolling flight,

    n_z_cmd -> alpha_des      q_des = q_Kbar + K_alpha (alpha_des - alpha_A)        q_K' = K_q (q_des - q_K)
    n_y_cmd -> beta_des       r_des = r_Kbar - K_beta (beta_des - beta_A)           r_s' = K_r (r_des - r_s)
    p_cmd                                                                           p_s' = K_p (p_cmd - p_s)

and then the deflections that make these accelerations. The surfaces' own forces turn the flight path, too: `q_Kbar` and
`r_Kbar` are linear in them, so that the equations remain linear, one for the elevator, two for ailerons and rudder.
"""

from airrace.model.aircraft import Aircraft, InnerLoopParameters
from airrace.model.dynamics.aerodynamics import moment_coefficients
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import (
    BRISK_COMMANDS,
    BodyPath,
    CommandControl,
    Commanded,
    Deflected,
    body_bounds,
    command_bounds,
    deflection_bounds,
)
from airrace.model.dynamics.outer_loop import turn_rates
from airrace.model.dynamics.rigid_body import Pair, body_axes, linear_parameters, pitching, roll_yaw_moments
from airrace.model.dynamics.state_space import (
    BODY_MOTION,
    LinearFlightState,
    Surrounding,
    lateral_load_factor,
    linear_flight,
    normal_load_factor,
    sideways,
    surrounding,
)
from airrace.model.environment import Air, Weather, g0
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Scalar, T, vector

ALPHA_BANDWIDTH = 6.0
"""The bandwidth of the link that commands alpha_K, 1/s."""
Q_BANDWIDTH = 12.0
"""That of the pitch rate, 1/s."""
P_BANDWIDTH = 12.0
"""That of the roll rate, 1/s."""
R_BANDWIDTH = 8.0
"""That of the yaw rate, 1/s."""
BETA_BANDWIDTH = 3.0
"""That of beta_K, 1/s."""


@vector
class StateSpaceInversionState(Commanded[T], LinearFlightState[T]):
    """The flight path, the throttle, the body motion and the commands."""


@vector
class StateSpaceInversionPath(Deflected[T], BodyPath[T]):
    """The path quantities of linear flight with a controller: `BodyPath` and the deflections."""


def deflections(
    state: StateSpaceInversionState[Scalar], around: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> Deflected[Scalar]:
    """Return the deflections (rad) that bring load factors and roll rate to the commands."""
    eta = elevator(state, around, aircraft)
    C_L = normal_load_factor(state, eta, around, aircraft)[1]
    xi, zeta = ailerons_and_rudder(state, C_L, around, aircraft)
    return Deflected(eta=eta, xi=xi, zeta=zeta)


def angle_of_attack(
    n_z: Scalar, state: LinearFlightState[Scalar], around: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> Scalar:
    """Return `alpha_A` (rad) at which a steady pull makes the load factor `n_z` (g).

    The pitch rate of the pull and the elevator that trims it are included.
    """
    q_trim = turn_rates(state.V_K, around.R, n_y=0.0, n_z=n_z)[0] * aircraft.cbar / (2.0 * around.flow.V_A)
    # the elevator that trims: eta = -(C_m0 + C_malpha alpha + C_mq q*) / C_meta
    lift_per_moment = aircraft.C_Leta / aircraft.C_meta
    C_L_rest = aircraft.C_L0 + aircraft.C_Lq * q_trim - lift_per_moment * (aircraft.C_m0 + aircraft.C_mq * q_trim)
    slope = around.load * (aircraft.C_Lalpha - lift_per_moment * aircraft.C_malpha) + around.pull
    return (n_z - around.load * C_L_rest) / slope


def elevator(
    state: StateSpaceInversionState[Scalar], around: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> Scalar:
    """Return the elevator `eta` (rad) for the commanded load factor."""
    alpha_des = angle_of_attack(state.n_z_cmd, state, around, aircraft)
    M = pitching(around.flow.V_A, around.rho, aircraft)
    n_z_neutral = normal_load_factor(state, 0.0, around, aircraft)[0]
    q_Kbar = turn_rates(state.V_K, around.R, n_y=0.0, n_z=n_z_neutral)[0]
    q_Kbar_eta = g0 * around.load * aircraft.C_Leta / state.V_K
    q_dot_cmd = Q_BANDWIDTH * (q_Kbar + ALPHA_BANDWIDTH * (alpha_des - around.seen.alpha_A) - state.q_K)
    q_dot_neutral = M.zero + M.alpha * around.seen.alpha_A + M.q * state.q_K + M.alphadot * (state.q_K - q_Kbar)
    return (q_dot_cmd - q_dot_neutral) / (M.eta - (M.alphadot + Q_BANDWIDTH) * q_Kbar_eta)


def ailerons_and_rudder(
    state: StateSpaceInversionState[Scalar], C_L: Scalar, around: Surrounding, aircraft: InnerLoopParameters[Scalar]
) -> Pair:
    """Return `(xi, zeta)` (rad) for the commanded lateral load factor and roll rate.

    The side force of the surfaces themselves turns the path, which takes more yaw acceleration: `f = f_0 + s f`. Here
    `f_0` belongs to the deflections that neglect this, and `s` to those that one more unit of yaw acceleration takes.
    """
    beta_A = around.seen.beta_A
    causes, neutral = (beta_A, state.p_s, state.r_s), (0.0, 0.0)
    n_y_neutral = lateral_load_factor(sideways(state, causes, neutral, around, aircraft), around, aircraft)
    r_Kbar = turn_rates(state.V_K, around.R, n_y=n_y_neutral, n_z=0.0)[1]
    error = sideslip(state.n_y_cmd, state, C_L, around, aircraft) - beta_A
    roll = P_BANDWIDTH * (state.p_cmd - state.p_s)
    yaw = R_BANDWIDTH * (r_Kbar - BETA_BANDWIDTH * error - state.r_s)
    xi_0, zeta_0 = surfaces_for((roll, yaw), state, causes, C_L, around, aircraft)
    xi_1, zeta_1 = surfaces_for((0.0, 1.0), state, (0.0, 0.0, 0.0), C_L, around, aircraft)
    turn = R_BANDWIDTH * g0 * around.load / state.V_K  # yaw acceleration wanted per unit of C_Y
    f_0 = turn * (aircraft.C_Yxi * xi_0 + aircraft.C_Yzeta * zeta_0)
    f = f_0 / (1.0 - turn * (aircraft.C_Yxi * xi_1 + aircraft.C_Yzeta * zeta_1))
    return xi_0 + f * xi_1, zeta_0 + f * zeta_1


def sideslip(
    n_y: Scalar,
    state: LinearFlightState[Scalar],
    C_L: Scalar,
    around: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
) -> Scalar:
    """Return `beta_A` (rad) at which trimmed, steady flight without rolling makes the load factor `n_y` (g)."""
    r_trim = turn_rates(state.V_K, around.R, n_y=n_y, n_z=0.0)[1]

    def trim_load_factor(beta_A: float, r_s: Scalar) -> Scalar:
        causes = (beta_A, 0.0, r_s)
        surfaces = surfaces_for((0.0, 0.0), state, causes, C_L, around, aircraft)
        return lateral_load_factor(sideways(state, causes, surfaces, around, aircraft), around, aircraft)

    return (n_y - trim_load_factor(0.0, r_trim)) / trim_load_factor(1.0, 0.0)


def surfaces_for(
    accelerations: Pair,
    state: LinearFlightState[Scalar],
    causes: tuple[Scalar, Scalar, Scalar],
    C_L: Scalar,
    around: Surrounding,
    aircraft: InnerLoopParameters[Scalar],
) -> Pair:
    """Return `(xi, zeta)` (rad) that make `(p_s', r_s')` (rad/s2) at `(beta_A, p_s, r_s)`, in rad and rad/s."""
    roll, yaw = roll_yaw_moments(*body_axes(state.alpha_K, *accelerations), aircraft)
    moment = around.load * aircraft.m * g0 * aircraft.b  # qbar S b
    C_l, C_n = moment_coefficients(sideways(state, causes, (0.0, 0.0), around, aircraft), C_L, aircraft)
    missing = (roll / moment - C_l, yaw / moment - C_n)
    return solve((aircraft.C_lxi, aircraft.C_nxi), (aircraft.C_lzeta, aircraft.C_nzeta), missing)


def solve(first: Pair, second: Pair, right: Pair) -> Pair:
    """Return `(a, b)` with `a one + b other = right`."""
    determinant = first[0] * second[1] - second[0] * first[1]
    return (
        (right[0] * second[1] - second[0] * right[1]) / determinant,
        (first[0] * right[1] - right[0] * first[1]) / determinant,
    )


def state_space_inversion(
    state: StateSpaceInversionState[Scalar],
    control: CommandControl[Scalar],
    *,
    aircraft: InnerLoopParameters[Scalar],
    weather: Weather,
) -> tuple[StateSpaceInversionState[Scalar], StateSpaceInversionPath[Scalar]]:
    """Return the time derivatives of the state, and the path quantities, by the numbers of `linear_parameters`."""
    around = surrounding(state, aircraft=aircraft, weather=weather)
    surfaces = deflections(state, around, aircraft)
    flight, path = linear_flight(state, surfaces, control.delta_T_cmd, around, aircraft)
    rates = StateSpaceInversionState[Scalar](
        **vars(flight), n_z_cmd=control.n_z_cmd_dot, n_y_cmd=control.n_y_cmd_dot, p_cmd=control.p_cmd_dot
    )
    return rates, StateSpaceInversionPath[Scalar](**vars(path), **vars(surfaces))


def build_state_space_inversion(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """Return the linear state space with its inversion controller, under the rules of a course.

    Raises:
        InputError: aircraft and rules leave no allowed value of some quantity.
    """
    return assemble(
        "state-space-inversion",
        state_space_inversion,
        (StateSpaceInversionState[Scalar], CommandControl[Scalar], StateSpaceInversionPath[Scalar]),
        {**body_bounds(aircraft, rules, "p_s"), **command_bounds(aircraft), **deflection_bounds(aircraft)},
        roll_rate=lambda state, _: state.p_s,
        at_rest=BODY_MOTION,
        aircraft=linear_parameters(aircraft),
        air=air,
        counting=counting,
        brisk=BRISK_COMMANDS,
    )
