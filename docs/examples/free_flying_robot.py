"""A robot of four thrusters flies to the origin in 12 s with the least thrust (Sakawa 1999)."""

import math

import casadi as ca

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, solve, uniform


def rates(x, u):
    F_1, F_2 = u.u1 - u.u2, u.u3 - u.u4
    v_x, v_y = (F_1 + F_2) * ca.cos(x.theta), (F_1 + F_2) * ca.sin(x.theta)
    return {"x": x.v_x, "y": x.v_y, "theta": x.omega, "v_x": v_x, "v_y": v_y, "omega": 0.2 * (F_1 - F_2)}


units = {"x": "m", "y": "m", "theta": "rad", "v_x": "m/s", "v_y": "m/s", "omega": "rad/s"}
problem = define_problem(
    "free-flying robot",
    rates,
    states=[Quantity(name, unit, 10.0 if unit == "m" else 1.0) for name, unit in units.items()],
    controls=[Quantity(f"u{number}", "m/s2", lower=0.0, upper=1.0) for number in (1, 2, 3, 4)],
    start=at(x=-10.0, y=-10.0, theta=math.pi / 2.0, v_x=0.0, v_y=0.0, omega=0.0),
    phases=[Phase("move", uniform(120), Interval.exactly(12.0), at(**dict.fromkeys(units, 0.0)))],
    integral_cost=lambda x, u: u.u1 + u.u2 + u.u3 + u.u4,
)
solution = solve(problem, refine=True)
print(solution)
