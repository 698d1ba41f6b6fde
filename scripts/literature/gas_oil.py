"""Rates of the catalytic cracking of gas oil, fitted to measurements (COPS 3; Tjoa & Biegler 1991)."""

from benchmark import Benchmark, fit

from airrace.optimal_control import Quantity

TIMES = (
    *(0.025, 0.05, 0.075, 0.10, 0.125, 0.15, 0.175, 0.20, 0.225, 0.25),
    *(0.30, 0.35, 0.40, 0.45, 0.50, 0.55, 0.65, 0.75, 0.85, 0.95),
)
GAS_OIL = (
    *(0.8105, 0.6208, 0.5258, 0.4345, 0.3903, 0.3342, 0.3034, 0.2735, 0.2405, 0.2283),
    *(0.2071, 0.1669, 0.1530, 0.1339, 0.1265, 0.1200, 0.0990, 0.0870, 0.0770, 0.0690),
)
GASOLINE = (
    *(0.2000, 0.2886, 0.3010, 0.3215, 0.3123, 0.2716, 0.2551, 0.2258, 0.1959, 0.1789),
    *(0.1457, 0.1198, 0.0909, 0.0719, 0.0561, 0.0460, 0.0280, 0.0190, 0.0140, 0.0100),
)


def benchmarks() -> tuple[Benchmark, ...]:
    problem = fit(
        "gas oil",
        lambda x, u: {"a": -(x.k1 + x.k3) * x.a**2, "b": x.k1 * x.a**2 - x.k2 * x.b},
        states=[Quantity("a", "1"), Quantity("b", "1")],
        parameters=[Quantity(f"k{number}", "1", 10.0, lower=0.0, upper=20.0) for number in (1, 2, 3)],
        start={"a": 1.0, "b": 0.0},
        times=TIMES,
        measured=tuple(zip(GAS_OIL, GASOLINE, strict=True)),
        intervals=2,
    )
    return (Benchmark("gas oil", problem, "5.23659e-3", "COPS 3, 5.2366e-3", "parameters", tolerance=1e-6),)
