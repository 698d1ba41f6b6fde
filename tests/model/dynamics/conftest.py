"""One complete aircraft and rules to fly by, shared by the tests of the dynamics."""

import math

import pytest

from airrace.model.aircraft import (
    Aircraft,
    Airframe,
    Drag,
    Envelope,
    Lift,
    PitchMoment,
    PointMassLimits,
    Propulsion,
    RollMoment,
    SideForce,
    Surfaces,
    YawMoment,
)
from airrace.model.track.course import Rules
from airrace.optimal_control.quantities import Interval

DEGREE = math.pi / 180.0


@pytest.fixture(scope="session")
def edge540() -> Aircraft:
    """Numbers of the Edge 540 class."""
    return Aircraft(
        name="Edge 540",
        airframe=Airframe(m=698.0, S=9.1, b=7.43, cbar=1.225, I_x=520.0, I_y=900.0, I_z=1300.0, I_xz=0.0),
        lift=Lift(C_L0=0.0, C_Lalpha=4.8, C_Lq=4.0, C_Leta=0.38, C_L_max=1.4, C_L_min=-1.4),
        drag=Drag(C_D0=0.022, k=0.069, C_L_minD=0.0, C_Dbeta2=0.85, beta_A_max=12.0 * DEGREE),
        side_force=SideForce(C_Ybeta=-0.55, C_Yp=0.0, C_Yr=0.23, C_Yxi=0.0, C_Yzeta=0.21),
        roll=RollMoment(C_lbeta=-0.03, C_lp=-0.45, C_lr=0.02, C_lr_per_C_L=0.25, C_lxi=-0.31, C_lzeta=0.014),
        pitch=PitchMoment(C_m0=0.0, C_malpha=-0.45, C_mq=-8.0, C_malphadot=-3.5, C_meta=-1.0),
        yaw=YawMoment(C_nbeta=0.09, C_np=0.0, C_np_per_C_L=-0.125, C_nr=-0.11, C_nxi=0.01, C_nzeta=-0.088),
        propulsion=Propulsion(P_max=223.7e3, eta_p=0.87, T_static=6200.0, tau_T=0.5),
        surfaces=Surfaces(
            eta=Interval(-25.0 * DEGREE, 25.0 * DEGREE),
            xi=Interval(-25.0 * DEGREE, 25.0 * DEGREE),
            zeta=Interval(-30.0 * DEGREE, 30.0 * DEGREE),
            rate=120.0 * DEGREE,
        ),
        point_mass=PointMassLimits(n_z_dot=40.0, n_y_dot=10.0, n_y=1.0, p=420.0 * DEGREE, p_dot=40.0),
        envelope=Envelope(V=Interval(35.0, 118.0), n_z=Interval(-10.0, 12.0)),
    )


@pytest.fixture(scope="session")
def rules() -> Rules:
    """Ten g, a roll rate below the aircraft's own, a floor and a ceiling."""
    return Rules(n_z=Interval(-4.0, 10.0), p=6.0, height=Interval(5.0, 300.0))
