"""A linear system keeps outside a ball whose radius has peaks in time, the alps (Betts 2010, 4.9).

Between the alps the limit is y'y >= 0 but for 1e-100, and is reached where its gradient is zero, so that no multiplier
exists. This engine finds no optimum on this mesh, nor does IPOPT within 500 iterations: both say so.
"""

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def rates(x, u):
    return {
        "t": 1.0,
        "y1": -10.0 * x.y1 + u.u1 + u.u2,
        "y2": -2.0 * x.y2 + u.u1 + 2.0 * u.u2,
        "y3": -3.0 * x.y3 + 5.0 * x.y4 + u.u1 - u.u2,
        "y4": 5.0 * x.y3 - 3.0 * x.y4 + u.u1 + 3.0 * u.u2,
    }


def above_alps(x, _):
    peaks = [(3.0, 3.0, 12.0), (3.0, 6.0, 10.0), (3.0, 10.0, 6.0), (8.0, 15.0, 4.0)]
    alps = sum(height * ca.exp(-sharpness * (x.t - time) ** 2) for height, time, sharpness in peaks)
    return x.y1**2 + x.y2**2 + x.y3**2 + x.y4**2 - alps


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "alp rider",
        rates,
        states=[Quantity("t", "s", 10.0), *(Quantity(f"y{n}", "1", 2.0) for n in (1, 2, 3, 4))],
        controls=[Quantity("u1", "1", 10.0), Quantity("u2", "1", 10.0)],
        outputs={Quantity("above_alps", "1", 5.0, lower=0.0): above_alps},
        start=at(t=0.0, y1=2.0, y2=1.0, y3=2.0, y4=1.0),
        phases=fixed_time(20.0, 400, y1=2.0, y2=3.0, y3=1.0, y4=-2.0),
        integral_cost=lambda x, u: 100.0 * (x.y1**2 + x.y2**2 + x.y3**2 + x.y4**2) + 0.01 * (u.u1**2 + u.u2**2),
        cost_scale=1000.0,
    )
    source = "Betts 2010"
    return (Benchmark("alp rider", problem, "2030.85609", source, "state-constrained", quick=False, tolerance=2.0),)
