"""Rates of the conversion of methanol into hydrocarbons, fitted to measurements (COPS 3)."""

from benchmark import Benchmark, fit

from airrace.optimal_control import Quantity

TIMES = (0.050, 0.065, 0.080, 0.123, 0.233, 0.273, 0.354, 0.397, 0.418, 0.502, 0.553, 0.681, 0.750, 0.916, 0.937, 1.122)
METHANOL = (
    *(0.7085, 0.5971, 0.5537, 0.3684, 0.1712, 0.1198, 0.0747, 0.0529),
    *(0.0415, 0.0261, 0.0208, 0.0085, 0.0053, 0.0019, 0.0018, 0.0006),
)
OLEFINS = (
    *(0.1621, 0.1855, 0.1989, 0.2845, 0.3491, 0.3098, 0.3576, 0.3347),
    *(0.3388, 0.3557, 0.3483, 0.3836, 0.3611, 0.3609, 0.3485, 0.3698),
)
PARAFFINS = (
    *(0.0811, 0.0965, 0.1198, 0.1535, 0.2097, 0.2628, 0.2467, 0.2884),
    *(0.2757, 0.3167, 0.2954, 0.2950, 0.2937, 0.2831, 0.2846, 0.2899),
)


def rates(x, u):
    share = x.k1 / ((x.k2 + x.k5) * x.a + x.b)
    return {
        "a": -(2.0 * x.k2 - share * x.b + x.k3 + x.k4) * x.a,
        "b": share * x.a * (x.k2 * x.a - x.b) + x.k3 * x.a,
        "c": share * x.a * (x.b + x.k5 * x.a) + x.k4 * x.a,
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = fit(
        "methanol",
        rates,
        states=[Quantity(name, "1") for name in ("a", "b", "c")],
        parameters=[Quantity(f"k{number}", "1", 3.0, lower=0.0, upper=20.0) for number in range(1, 6)],
        start={"a": 1.0, "b": 0.0, "c": 0.0},
        times=TIMES,
        measured=tuple(zip(METHANOL, OLEFINS, PARAFFINS, strict=True)),
        intervals=2,
    )
    return (Benchmark("methanol", problem, "9.02229e-3", "COPS 3", "parameters", tolerance=2e-6),)
