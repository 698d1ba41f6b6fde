"""A stirred tank that makes the most profit in 0.2 h, with three controls (Jensen 1964; Luus 2000)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem

LARGEST = (20.0, 6.0, 4.0)
FEED = 6.0
BEGIN = (0.1883, 0.2507, 0.0467, 0.0899, 0.1804, 0.1394, 0.1046)


def flow(u):
    return u.u1 + u.u2 + FEED


def rates(x, u):
    q = flow(u)
    return {
        "x1": FEED - q * x.x1 - 17.6 * x.x1 * x.x2 - 23.0 * x.x1 * x.x6 * u.u3,
        "x2": u.u1 - q * x.x2 - 17.6 * x.x1 * x.x2 - 146.0 * x.x2 * x.x3,
        "x3": u.u2 - q * x.x3 - 73.0 * x.x2 * x.x3,
        "x4": -q * x.x4 + 35.2 * x.x1 * x.x2 - 51.3 * x.x4 * x.x5,
        "x5": -q * x.x5 + 219.0 * x.x2 * x.x3 - 51.3 * x.x4 * x.x5,
        "x6": -q * x.x6 + 102.6 * x.x4 * x.x5 - 23.0 * x.x1 * x.x6 * u.u3,
        "x7": -q * x.x7 + 46.0 * x.x1 * x.x6 * u.u3,
    }


def profit(x, u):
    sales = flow(u) * (5.8 * x.x1 + 23.0 * x.x4 + 11.0 * x.x5 + 28.0 * x.x6 + 35.0 * x.x7)
    return sales - 5.8 * FEED - 3.7 * u.u1 - 4.1 * u.u2 - 5.0 * u.u3**2 - 0.099


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "three feeds",
        rates,
        states=[Quantity(f"x{row}", "1", 0.2) for row in range(1, 8)],
        controls=[
            Quantity(f"u{row}", "1", 5.0, lower=0.0, upper=top) for row, top in enumerate((20.0, 6.0, 4.0, 20.0), 1)
        ],
        start=at(**{f"x{row}": value for row, value in enumerate(BEGIN, 1)}),
        phases=fixed_time(0.2, 80),
        integral_cost=lambda x, u: -profit(x, u),
        cost_scale=20.0,
        time_scale=0.2,
    )
    return (Benchmark("three feeds", problem, "20.09586", "Luus 2000, 20.0958", maximum=True),)
