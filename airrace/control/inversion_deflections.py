"""The inverse of a model with control surfaces: surface -> rate -> angle -> load factor, backwards.

The body's rates about the axes of Kbar are `w = (w_x, w_y, w_z)`; their derivatives are affine in the deflections
`d = (eta, xi, zeta)`, so with `B = d(w')/dd` the deflections for any `w'` are `d + B^-1 (w'_des - w')`. Those for
`w' = 0` are the trim, at which the angles for the commanded load factors are sought:

    alpha_des = alpha + (n_z_cmd - n_z) / (dn_z/dalpha)           beta_des = beta + (n_y_cmd - n_y) / (dn_y/dbeta)
    alpha'_des = K_alpha (alpha_des - alpha) + n_z_dot / (dn_z/dalpha)       beta'_des = K_beta (beta_des - beta)
    w'_des = [p_dot + K_p (p_cmd - p_Kbar),  K_q (alpha'_des - alpha'),  K_r (beta' - beta'_des)]

(`alpha' = w_y - q_Kbar` and `beta' = r_Kbar - w_z` but for the cosine of the sideslip.)
"""

from collections.abc import Callable, Sequence

from airrace.control.inner_controller import (
    FOLLOWER,
    LEAST_LIFT_SLOPE,
    LEAST_SIDE_SLOPE,
    InnerController,
    Named,
    Plant,
    declared,
    jacobian,
    limited,
    solve,
)
from airrace.control.inner_controller import substitute as with_values
from airrace.control.outer_loop import clip
from airrace.dynamics.flight_model import FlightModel, column
from airrace.environment.atmosphere import g0
from airrace.environment.elementary import cos, maximum, minimum, sin
from airrace.frames import Scalar
from airrace.quantities import T, Vector, quantity, vector

K_ALPHA, K_BETA = 8.0, 5.0
K_P, K_Q, K_R = 12.0, 20.0, 12.0
DEFLECTIONS = ("eta", "xi", "zeta")

BodyRates = Callable[[Named], tuple[Scalar, Scalar, Scalar]]
"""`(w_x, w_y, w_z)` of a state, rad/s."""


@vector
class _Wanted(Vector[T]):
    """Of the angles and the rates; the errors are those of `(w_x, w_y, w_z)`."""

    alpha: T = quantity("rad")
    beta: T = quantity("rad")
    roll: T = quantity("rad/s")
    pitch: T = quantity("rad/s")
    yaw: T = quantity("rad/s")


def invert_six_dof(model: FlightModel) -> InnerController:
    """The controller of the model with the nonlinear moments about the body axes."""
    return _inverse(model, ("p_K", "q_K", "r_K"), _body_rates_in_Kbar)


def invert_state_space(model: FlightModel) -> InnerController:
    """The controller of the linear model, whose rates are those about the stability axes."""
    rates = ("p_s", "q_K", "r_s")
    return _inverse(model, rates, lambda x: (x["p_s"], x["q_K"], x["r_s"]))


def _body_rates_in_Kbar(x: Named) -> tuple[Scalar, Scalar, Scalar]:
    alpha, beta, p, q, r = (x[name] for name in ("alpha_K", "beta_K", "p_K", "q_K", "r_K"))
    s = p * cos(alpha) + r * sin(alpha)
    return cos(beta) * s + sin(beta) * q, cos(beta) * q - sin(beta) * s, r * cos(alpha) - p * sin(alpha)


def _inverse(model: FlightModel, rate_names: Sequence[str], body_rates: BodyRates) -> InnerController:
    plant = Plant(model)
    x, command = plant.x, plant.commands
    w = column(body_rates(x))
    w_dot = jacobian(w, column(x.values())) @ column(plant.rates.values())
    deflections = column(x[name] for name in DEFLECTIONS)
    effect = jacobian(w_dot, deflections)
    wanted = _wanted(plant, deflections - solve(effect, w_dot))
    path_turns = g0 / x["V_K"] * jacobian(plant.load.n_z, x["alpha_K"]) * plant.rates["alpha_K"]
    w_dot_des = column([command.p_dot + K_P * wanted.roll, path_turns + K_Q * wanted.pitch, K_R * wanted.yaw])
    for_motion = deflections + solve(effect, w_dot_des - w_dot)
    steady = column([limited_roll_rate(plant) - plant.load.p_Kbar, -plant.rates["alpha_K"], plant.rates["beta_K"]])
    rates = column(x[name] for name in rate_names)
    turning = rates + solve(jacobian(w, rates), steady)
    trim = deflections - solve(effect, w_dot)
    return plant.controller(
        {name: for_motion[row] for row, name in enumerate(DEFLECTIONS)},
        {
            "alpha_K": wanted.alpha,
            "beta_K": wanted.beta,
            **{name: turning[row] for row, name in enumerate(rate_names)},
            **{name: limited(plant.system, name, trim[row]) for row, name in enumerate(DEFLECTIONS)},
        },
    )


def _wanted(plant: Plant, trim: Scalar) -> _Wanted[Scalar]:
    """Angles for the commanded load factors with the deflections of `trim`, and errors of the rates towards them."""
    x, command, system = plant.x, plant.commands, plant.system
    variables = column(x[name] for name in DEFLECTIONS)
    n_z, n_y, lift_slope, side_slope = (
        with_values(one, variables, trim)
        for one in (
            plant.load.n_z,
            plant.load.n_y,
            jacobian(plant.load.n_z, x["alpha_K"]),
            jacobian(plant.load.n_y, x["beta_K"]),
        )
    )
    lift_slope, side_slope = maximum(lift_slope, LEAST_LIFT_SLOPE), minimum(side_slope, -LEAST_SIDE_SLOPE)
    higher = _within(plant, "alpha_A", (limited(system, "n_z", command.n_z) - n_z) / lift_slope)
    further = _within(plant, "beta_A", (limited(system, "n_y", command.n_y) - n_y) / side_slope)
    alpha_dot = K_ALPHA * higher + (1.0 + K_ALPHA / FOLLOWER) * command.n_z_dot / lift_slope
    return _Wanted(
        alpha=x["alpha_K"] + higher,
        beta=x["beta_K"] + further,
        roll=limited_roll_rate(plant) - plant.load.p_Kbar,
        pitch=alpha_dot - plant.rates["alpha_K"],
        yaw=plant.rates["beta_K"] - K_BETA * further,
    )


def limited_roll_rate(plant: Plant) -> Scalar:
    """The commanded roll rate within the model's limit."""
    name = "p_s" if "p_s" in plant.x else "p_Kbar"
    return limited(plant.system, name, plant.commands.p)


def _within(plant: Plant, name: str, change: Scalar) -> Scalar:
    """A change of an angle that keeps the path quantity `name`, which changes along with it, within its bounds."""
    bounds, now = declared(plant.system.path, name), plant.path[name]
    return clip(change, bounds.lower - now, bounds.upper - now)
