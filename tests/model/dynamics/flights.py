"""Random flights for the tests of the dynamics: states, controls, airs, and their mirror images."""

import dataclasses

from hypothesis import strategies as st

from airrace.model.dynamics.point_mass import PointMassControl, PointMassState
from airrace.model.environment import Air, Profile, StaticWind, Thermal
from airrace.model.frames import quaternion

angle = st.floats(-3.1, 3.1)
climb = st.floats(-1.5, 1.5)


def _state(chi: float, gamma: float, mu: float, **others: float) -> PointMassState[float]:
    q0, q1, q2, q3 = quaternion(chi, gamma, mu)
    return PointMassState(q0=q0, q1=q1, q2=q2, q3=q3, **others)


states = st.builds(
    _state,
    angle,
    climb,
    angle,
    x=st.floats(-500.0, 500.0),
    y=st.floats(-500.0, 500.0),
    z=st.floats(-300.0, -5.0),
    V_K=st.floats(45.0, 115.0),
    delta_T=st.floats(0.0, 1.0),
    n_z=st.floats(-4.0, 10.0),
    n_y=st.floats(-1.0, 1.0),
    p_Kbar=st.floats(-7.0, 7.0),
)
controls = st.builds(
    PointMassControl,
    n_z_dot=st.floats(-40.0, 40.0),
    n_y_dot=st.floats(-10.0, 10.0),
    p_Kbar_dot=st.floats(-40.0, 40.0),
    delta_T_cmd=st.floats(0.0, 1.0),
)
HOLD = PointMassControl(n_z_dot=0.0, n_y_dot=0.0, p_Kbar_dot=0.0, delta_T_cmd=1.0)
static_winds = st.builds(
    StaticWind, origin=angle, speed=st.floats(0.0, 15.0), profile=st.sampled_from(Profile), roughness=st.just(0.1)
)
thermals = st.builds(
    Thermal,
    north=st.floats(-300.0, 300.0),
    east=st.floats(-300.0, 300.0),
    w_star=st.floats(0.5, 4.0),
    mixing_height=st.floats(500.0, 2500.0),
)
windy_airs = st.builds(
    Air,
    temperature_offset=st.floats(-20.0, 25.0),
    elevation=st.floats(0.0, 1500.0),
    wind=static_winds,
    thermals=st.lists(thermals, max_size=2).map(tuple),
)


def mirrored_air(air: Air) -> Air:
    """The air seen in that mirror."""
    wind = air.wind and dataclasses.replace(air.wind, origin=-air.wind.origin)
    return dataclasses.replace(
        air, wind=wind, thermals=tuple(dataclasses.replace(one, east=-one.east) for one in air.thermals)
    )
