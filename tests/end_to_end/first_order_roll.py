"""A fidelity in one file: the point mass whose roll rate follows its command as a first-order lag does.

p_Kbar' = (p_cmd - p_Kbar) / TAU
"""

from airrace.model.aircraft import Aircraft, AircraftParameters, aircraft_parameters
from airrace.model.dynamics.aerodynamics import LoadFactorPath
from airrace.model.dynamics.flight_model import FlightModel, assemble
from airrace.model.dynamics.limits import load_factor_bounds, symmetric
from airrace.model.dynamics.point_mass import PointMassControl, PointMassState, point_mass
from airrace.model.environment import Air, Weather
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Quantity, Scalar, T, Vector, quantity, vector
from airrace.procedure.control.dynamic_inversion import InnerController, Plant, within_bounds
from airrace.procedure.fidelity import Fidelity, register
from airrace.procedure.stage import Stage

TAU = 0.08
"""The time constant of the roll, s."""
K_P = 8.0
"""1/s, how fast the controller takes back an error of the roll rate."""


@vector
class RollingState(PointMassState[T]):
    """The point mass and the roll rate that is commanded."""

    p_cmd: T = quantity("rad/s", scale=3.0, text="commanded roll rate")


@vector
class RollingControl(Vector[T]):
    """Rates of what the pilot commands, and the commanded lever."""

    n_z_dot: T = quantity("1/s", scale=20.0, text="rate of the load factor", rate_of="n_z")
    n_y_dot: T = quantity("1/s", scale=5.0, text="rate of the lateral load factor", rate_of="n_y")
    p_cmd_dot: T = quantity("rad/s2", scale=20.0, text="rate of the commanded roll rate", rate_of="p_cmd")
    delta_T_cmd: T = quantity("1", lower=0.0, upper=1.0, text="commanded throttle")


def rolling(
    state: RollingState[Scalar],
    control: RollingControl[Scalar],
    *,
    aircraft: AircraftParameters[Scalar],
    weather: Weather,
) -> tuple[RollingState[Scalar], LoadFactorPath[Scalar]]:
    """Time derivatives of the state, and the path quantities."""
    exact = PointMassControl[Scalar](
        n_z_dot=control.n_z_dot,
        n_y_dot=control.n_y_dot,
        p_Kbar_dot=(state.p_cmd - state.p_Kbar) / TAU,
        delta_T_cmd=control.delta_T_cmd,
    )
    rates, path = point_mass(state, exact, aircraft=aircraft, weather=weather)
    return RollingState[Scalar](**vars(rates), p_cmd=control.p_cmd_dot), path


def build_rolling(aircraft: Aircraft, rules: Rules, air: Air, *, counting: bool = False) -> FlightModel:
    """The model of an aircraft under the rules of a course in the air of the day."""
    pilot = aircraft.point_mass
    bounds = {
        "n_z_dot": symmetric(pilot.n_z_dot),
        "n_y_dot": symmetric(pilot.n_y_dot),
        "p_cmd": symmetric(pilot.p),
        "p_cmd_dot": symmetric(pilot.p_dot),
    }
    return assemble(
        "first-order-roll",
        rolling,
        (RollingState[Scalar], RollingControl[Scalar], LoadFactorPath[Scalar]),
        {**load_factor_bounds(aircraft, rules), **bounds},
        roll_rate=lambda state, _: state.p_Kbar,
        at_rest=("p_Kbar",),
        aircraft=aircraft_parameters(aircraft),
        air=air,
        counting=counting,
    )


def invert_rolling(model: FlightModel) -> InnerController:
    """The controller: load factors are moved at once, the command of the roll leads its lag."""
    plant = Plant(model)
    x, command = plant.x, plant.commands
    n_z, n_y = within_bounds(model.system, "n_z", command.n_z), within_bounds(model.system, "n_y", command.n_y)
    p = within_bounds(model.system, "p_Kbar", command.p)
    leading = x["p_Kbar"] + TAU * (command.p_dot + K_P * (p - x["p_Kbar"]))
    return plant.controller(
        wanted={"n_z": n_z, "n_y": n_y, "p_cmd": leading},
        settled={"n_z": n_z, "n_y": n_y, "p_Kbar": p, "p_cmd": p + TAU * command.p_dot},
    )


LAG = Quantity("p_lag", "rad/s", text="how far the roll rate lags behind its command")

FIRST_ORDER_ROLL = register(
    Fidelity(
        Stage.new("first-order-roll", after=Stage.POINT_MASS),
        build_rolling,
        inner_controller=invert_rolling,
        longest_interval=0.1,
        columns={LAG: lambda histories: histories["p_cmd"] - histories["p_Kbar"]},
    )
)
