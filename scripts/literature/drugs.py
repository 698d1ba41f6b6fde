"""Two drugs that displace each other, brought to their levels in least time (Luus 2000, 12.4.3; PROPT)."""

from benchmark import Benchmark, free_time

from airrace.optimal_control import Quantity, at, define_problem, initial_guess


def rates(x, u):
    bound = 1.0 + 0.2 * (x.w + x.p)
    g_3, g_4 = bound**2 + 232.0 + 46.4 * x.p, bound**2 + 232.0 + 46.4 * x.w
    share = bound**2 / (g_3 * g_4 - 2152.96 * x.w * x.p)
    return {
        "w": share * (g_4 * (0.02 - x.w) + 46.4 * x.w * (u.u - 2.0 * x.p)),
        "p": share * (g_3 * (u.u - 2.0 * x.p) + 46.4 * (0.02 - x.w)),
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "drug displacement",
        rates,
        states=[Quantity("w", "1", 0.02), Quantity("p", "1")],
        controls=[Quantity("u", "1", 8.0, lower=0.0, upper=8.0)],
        start=at(w=0.02, p=0.0),
        phases=free_time(100.0, 500.0, 200, w=0.02, p=2.0),
        time_scale=200.0,
    )
    control = [8.0 * (1.0 - (row + 0.5) / 200.0) for row in range(200)]
    guess = initial_guess(problem, [250.0], u=control)
    source = "Luus 2000; PROPT 221.333"
    return (Benchmark("drug displacement", problem, "221.33", source, "bang-bang", guess, tolerance=0.2),)
