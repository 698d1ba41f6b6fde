"""Reactors that make the most of the middle of A -> B -> C, or of B beside C (Ray 1981; Biegler 1984)."""

import casadi as ca
from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem


def consecutive(x, u):
    k_1, k_2 = 4000.0 * ca.exp(-2500.0 / u.T), 620000.0 * ca.exp(-5000.0 / u.T)
    return {"a": -k_1 * x.a**2, "b": k_1 * x.a**2 - k_2 * x.b}


def benchmarks() -> tuple[Benchmark, ...]:
    yields = [Quantity("a", "1"), Quantity("b", "1")]
    chain = define_problem(
        "batch reactor",
        consecutive,
        states=yields,
        controls=[Quantity("T", "K", 350.0, lower=298.0, upper=398.0)],
        start=at(a=1.0, b=0.0),
        phases=fixed_time(1.0, 100),
        end_cost=lambda ends: -ends[-1].b,
    )
    parallel = define_problem(
        "parallel reactions",
        lambda x, u: {"a": -(u.u + 0.5 * u.u**2) * x.a, "b": u.u * x.a},
        states=yields,
        controls=[Quantity("u", "1", lower=0.0, upper=5.0)],
        start=at(a=1.0, b=0.0),
        phases=fixed_time(1.0, 100),
        end_cost=lambda ends: -ends[-1].b,
    )
    return (
        Benchmark("batch reactor", chain, "0.610775", "Dadebo & McAuley 1995", maximum=True),
        Benchmark("parallel reactions", parallel, "0.57353", "Dadebo & McAuley 1995", maximum=True),
    )
