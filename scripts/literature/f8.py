"""The F-8 brought back to trim in least time by its elevator: four arcs (Kaya & Noakes 2003; Sager 2005)."""

from benchmark import Benchmark

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, initial_guess, uniform

ELEVATOR = 0.05236

ARCS = (1.13492, 0.34703, 1.60721, 0.69169)


def rates(x, u):
    a, w = x.alpha, u.w
    return {
        "alpha": -0.877 * a
        + x.q
        - 0.088 * a * x.q
        + 0.47 * a**2
        - 0.019 * x.theta**2
        - a**2 * x.q
        + 3.846 * a**3
        - 0.215 * w
        + 0.28 * a**2 * w
        + 0.47 * a * w**2
        + 0.63 * w**3,
        "theta": x.q,
        "q": -4.208 * a
        - 0.396 * x.q
        - 0.47 * a**2
        - 3.564 * a**3
        - 20.967 * w
        + 6.265 * a**2 * w
        + 46.0 * a * w**2
        + 61.4 * w**3,
    }


def benchmarks() -> tuple[Benchmark, ...]:
    ends = [at(), at(), at(), at("trim", alpha=0.0, theta=0.0, q=0.0)]
    problem = define_problem(
        "F-8",
        rates,
        states=[Quantity("alpha", "rad", 0.5), Quantity("theta", "rad", 0.5), Quantity("q", "rad/s", 0.5)],
        controls=[Quantity("w", "rad", 0.05, lower=-ELEVATOR, upper=ELEVATOR)],
        start=at(alpha=0.4655, theta=0.0, q=0.0),
        phases=[
            Phase(f"arc {row}", uniform(10), Interval(0.02, 5.0), end, bounds={"w": Interval.exactly(sign * ELEVATOR)})
            for row, (end, sign) in enumerate(zip(ends, (1.0, -1.0, 1.0, -1.0), strict=True), 1)
        ],
    )
    guess = initial_guess(
        problem,
        ARCS,
        alpha=[0.4655, -0.55, -0.70, 0.28, 0.0],
        theta=[0.0, -1.16, -1.21, 0.27, 0.0],
        q=[0.0, -0.90, 0.62, -0.58, 0.0],
    )
    return (Benchmark("F-8", problem, "3.78086", "Sager 2005", "multi-phase", guess),)
