"""Rates of the isomerization of alpha-pinene, fitted to measurements (COPS 3; Box et al. 1973)."""

from benchmark import Benchmark, fit

from airrace.optimal_control import Quantity

HOURS = 3600.0
TIMES = (1230.0, 3060.0, 4920.0, 7800.0, 10680.0, 15030.0, 22620.0, 36420.0)
SHARES = (
    (88.35, 76.4, 65.1, 50.4, 37.5, 25.9, 14.0, 4.5),
    (7.3, 15.6, 23.1, 32.9, 42.7, 49.1, 57.4, 63.1),
    (2.3, 4.5, 5.3, 6.0, 6.0, 5.9, 5.1, 3.8),
    (0.4, 0.7, 1.1, 1.5, 1.9, 2.2, 2.6, 2.9),
    (1.75, 2.8, 5.8, 9.3, 12.0, 17.0, 21.0, 25.7),
)


def rates(x, u):
    """Per hour."""
    return {
        "y1": -(x.k1 + x.k2) * x.y1,
        "y2": x.k1 * x.y1,
        "y3": x.k2 * x.y1 - (x.k3 + x.k4) * x.y3 + x.k5 * x.y5,
        "y4": x.k3 * x.y3,
        "y5": x.k4 * x.y3 - x.k5 * x.y5,
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = fit(
        "alpha-pinene",
        rates,
        states=[Quantity(f"y{number}", "%", 50.0) for number in range(1, 6)],
        parameters=[Quantity(f"k{number}", "1/h", 0.2, lower=0.0, upper=2.0) for number in range(1, 6)],
        start={"y1": 100.0, "y2": 0.0, "y3": 0.0, "y4": 0.0, "y5": 0.0},
        times=[time / HOURS for time in TIMES],
        measured=tuple(zip(*SHARES, strict=True)),
        intervals=3,
    )
    return (Benchmark("alpha-pinene", problem, "19.8721", "COPS 3", "parameters"),)
