"""Aircraft that rotate, for the tests of the models with an inner loop: states, mirror images, trims."""

import dataclasses
from typing import Any

import numpy as np
from flights import HOLD, angle, climb
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from airrace.model.aircraft import Aircraft, InnerLoopParameters, aircraft_parameters, inner_loop_parameters
from airrace.model.dynamics.aerodynamics import LoadFactorPath
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.limits import BodyPath, CommandControl, SurfaceControl
from airrace.model.dynamics.point_mass import PointMassControl, PointMassState, point_mass
from airrace.model.dynamics.rigid_body import linear_parameters
from airrace.model.dynamics.six_dof import SixDofPath, SixDofState, six_dof
from airrace.model.dynamics.state_space import StateSpaceState, state_space
from airrace.model.dynamics.state_space_inversion import (
    StateSpaceInversionPath,
    StateSpaceInversionState,
    state_space_inversion,
)
from airrace.model.dynamics.transfer_functions import TransferFunctionState, transfer_functions
from airrace.model.environment import Air, Weather, WindField, atmosphere_parameters
from airrace.model.frames import quaternion

Array = NDArray[np.float64]
KNOT = 1852.0 / 3600.0
ODD = {"y", "q1", "q3", "n_y", "n_y_dot", "n_y_cmd", "n_y_cmd_dot", "p_Kbar", "p_cmd", "p_cmd_dot"} | {
    *("beta_K", "beta_A", "p_K", "r_K", "p_s", "r_s", "xi", "zeta", "xi_dot", "zeta_dot")
}
"""What changes its sign in a mirror that exchanges left and right."""
STICK_FREE = SurfaceControl(eta_dot=0.0, xi_dot=0.0, zeta_dot=0.0, delta_T_cmd=0.5)
COMMANDS_HELD = CommandControl(n_z_cmd_dot=0.0, n_y_cmd_dot=0.0, p_cmd_dot=0.0, delta_T_cmd=0.5)


def _six_dof_state(chi: float, gamma: float, mu: float, **others: float) -> SixDofState[float]:
    q0, q1, q2, q3 = quaternion(chi, gamma, mu)
    return SixDofState(q0=q0, q1=q1, q2=q2, q3=q3, **others)


bodies = st.builds(
    _six_dof_state,
    angle,
    climb,
    angle,
    x=st.floats(-500.0, 500.0),
    y=st.floats(-500.0, 500.0),
    z=st.floats(-300.0, -5.0),
    V_K=st.floats(45.0, 115.0),
    delta_T=st.floats(0.0, 1.0),
    alpha_K=st.floats(-0.35, 0.35),
    beta_K=st.floats(-0.25, 0.25),
    p_K=st.floats(-7.0, 7.0),
    q_K=st.floats(-2.0, 2.0),
    r_K=st.floats(-2.0, 2.0),
    eta=st.floats(-0.4, 0.4),
    xi=st.floats(-0.4, 0.4),
    zeta=st.floats(-0.5, 0.5),
)


def as_state_space(state: SixDofState[float]) -> StateSpaceState[float]:
    """Some state of the linear model: the same numbers, taken for rates in stability axes."""
    values = vars(state) | {"p_s": state.p_K, "r_s": state.r_K}
    return StateSpaceState(**{name: values[name] for name in StateSpaceState.names()})


def as_state_space_inversion(state: SixDofState[float]) -> StateSpaceInversionState[float]:
    """Some state of the controlled model: deflections make numbers for the commands."""
    commands = {"n_z_cmd": 20.0 * state.eta, "n_y_cmd": state.zeta, "p_cmd": 10.0 * state.xi}
    values = vars(as_state_space(state)) | commands
    return StateSpaceInversionState(**{name: values[name] for name in StateSpaceInversionState.names()})


def as_point_mass(state: SixDofState[float]) -> PointMassState[float]:
    """Some state of the point mass, of the same numbers as the transfer functions'."""
    values = vars(as_transfer_functions(state))
    return PointMassState(**{name: values[name] for name in PointMassState.names()})


def as_transfer_functions(state: SixDofState[float]) -> TransferFunctionState[float]:
    """Some state of the transfer functions: angles and rates make numbers for the load factors."""
    inner = {
        "n_z": 25.0 * state.alpha_K,
        "n_z_dot": 10.0 * state.q_K,
        "n_y": state.beta_K,
        "n_y_dot": state.r_K,
        "p_Kbar": state.p_K,
    }
    values = vars(as_state_space_inversion(state)) | inner
    return TransferFunctionState(**{name: values[name] for name in TransferFunctionState.names()})


def fly_six_dof(
    flown: Aircraft | InnerLoopParameters[float],
    air: Air,
    state: SixDofState[float],
    control: SurfaceControl[float] = STICK_FREE,
) -> tuple[SixDofState[float], SixDofPath[float]]:
    """Rates and path quantities of the six-dof model."""
    numbers = inner_loop_parameters(flown) if isinstance(flown, Aircraft) else flown
    return six_dof(state, control, aircraft=numbers, **surroundings(air))


def fly_state_space(
    aircraft: Aircraft, air: Air, state: StateSpaceState[float], control: SurfaceControl[float] = STICK_FREE
) -> tuple[StateSpaceState[float], BodyPath[float]]:
    """Rates and path quantities of the linear model."""
    return state_space(state, control, aircraft=linear_parameters(aircraft), **surroundings(air))


def fly_state_space_inversion(
    aircraft: Aircraft,
    air: Air,
    state: StateSpaceInversionState[float],
    control: CommandControl[float] = COMMANDS_HELD,
) -> tuple[StateSpaceInversionState[float], StateSpaceInversionPath[float]]:
    """Rates and path quantities of the controlled linear model."""
    return state_space_inversion(state, control, aircraft=linear_parameters(aircraft), **surroundings(air))


def fly_transfer_functions(
    aircraft: Aircraft, air: Air, state: TransferFunctionState[float], control: CommandControl[float] = COMMANDS_HELD
) -> tuple[TransferFunctionState[float], LoadFactorPath[float]]:
    """Rates and path quantities of the transfer functions."""
    return transfer_functions(state, control, aircraft=linear_parameters(aircraft), **surroundings(air))


def fly_point_mass(
    aircraft: Aircraft, air: Air, state: PointMassState[float], control: PointMassControl[float] = HOLD
) -> tuple[PointMassState[float], LoadFactorPath[float]]:
    """Rates and path quantities of the point mass."""
    return point_mass(state, control, aircraft=aircraft_parameters(aircraft), **surroundings(air))


def surroundings(air: Air) -> dict[str, Any]:
    """The arguments of a model that belong to the air."""
    field = WindField.from_air(air)
    return {"weather": Weather(atmosphere_parameters(air), field, field.values(air))}


def wind_at(air: Air, position: tuple[float, float, float]) -> Array:
    """The wind in O, m/s."""
    field = WindField.from_air(air)
    return np.array(field.velocity(*position, field.values(air)))


def mirrored(vector: Any) -> Any:
    """A state, its rates, a control or path quantities, seen in the mirror."""
    return dataclasses.replace(vector, **{name: -value for name, value in vars(vector).items() if name in ODD})


def body_attitude(state: SixDofState[float]) -> Array:
    """`R_OB`, from components in the body to components in O, by other means than those under test."""
    R_OKbar = Rotation.from_quat([state.q1, state.q2, state.q3, state.q0])
    return np.array((R_OKbar * Rotation.from_euler("ZY", [-state.beta_K, state.alpha_K])).as_matrix())


def evaluated(model: FlightModel, state: Any, control: Any) -> tuple[Array, Array]:
    """Rates and path values of a compiled model."""
    assert model.system.path_values is not None
    arguments = (state.join(), control.join(), model.parameter_values)
    return np.array(model.system.rates(*arguments)).ravel(), np.array(model.system.path_values(*arguments)).ravel()


def level_trim(aircraft: Aircraft, V_K: float) -> SixDofState[float]:
    """Straight and level flight of the six-dof model, wings level."""
    start = _six_dof_state(
        0.0, 0.0, 0.0, x=0.0, y=0.0, z=-50.0, V_K=V_K, delta_T=0.5, alpha_K=0.03, beta_K=0.0, p_K=0.0, q_K=0.0, r_K=0.0,
        eta=0.0, xi=0.0, zeta=0.0
    )  # fmt: skip

    def trimmed(unknowns: Array) -> SixDofState[float]:
        delta_T, alpha_K, eta = (float(one) for one in unknowns)
        return dataclasses.replace(start, delta_T=delta_T, alpha_K=alpha_K, eta=eta)

    def residual(unknowns: Array) -> list[float]:
        rate, _ = fly_six_dof(aircraft, Air(), trimmed(unknowns))
        return [rate.V_K, rate.alpha_K, rate.q_K]

    found = root(residual, [0.3, 0.05, 0.0], tol=1e-12)
    assert found.success or max(abs(one) for one in residual(found.x)) < 1e-9
    return trimmed(found.x)


def endless_wing(aircraft: Aircraft) -> Aircraft:
    """The aircraft with a lift curve that is straight to the last digit."""
    return dataclasses.replace(aircraft, lift=dataclasses.replace(aircraft.lift, C_L_max=1e4, C_L_min=-1e4))


def with_pitch(aircraft: Aircraft, **pitch: float) -> Aircraft:
    return dataclasses.replace(aircraft, pitch=dataclasses.replace(aircraft.pitch, **pitch))


def with_airframe(aircraft: Aircraft, **airframe: float) -> Aircraft:
    return dataclasses.replace(aircraft, airframe=dataclasses.replace(aircraft.airframe, **airframe))
