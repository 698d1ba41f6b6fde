"""The treatment of two strains of tuberculosis over five years (Jung, Lenhart & Feng 2002; Betts 2010)."""

from benchmark import Benchmark, fixed_time

from airrace.optimal_control import Quantity, at, define_problem

PEOPLE, DEATHS = 30000.0, 0.0143
BETA, BETA_RESISTANT = 13.0, 0.029
P, Q, K_1, K_2, R_1, R_2 = 0.4, 0.1, 0.5, 1.0, 2.0, 1.0
SHARES = {"S": 76.0, "T": 1.0, "L1": 36.0, "L2": 2.0, "I1": 4.0, "I2": 1.0}


def rates(x, u):
    infected, resistant = BETA * x.I1 / PEOPLE, BETA_RESISTANT * x.I2 / PEOPLE
    failing = (1.0 - u.u2) * R_2 * x.I1
    return {
        "S": DEATHS * PEOPLE - infected * x.S - resistant * x.S - DEATHS * x.S,
        "T": u.u1 * R_1 * x.L1 - DEATHS * x.T + R_2 * x.I1 - (P + Q) * failing - infected * x.T - resistant * x.T,
        "L1": infected * (x.S + x.T) - (DEATHS + K_1) * x.L1 - u.u1 * R_1 * x.L1 + P * failing - resistant * x.L1,
        "L2": Q * failing - (DEATHS + K_2) * x.L2 + resistant * (x.S + x.L1 + x.T),
        "I1": K_1 * x.L1 - (DEATHS + R_2) * x.I1,
        "I2": K_2 * x.L2 - DEATHS * x.I2,
    }


def benchmarks() -> tuple[Benchmark, ...]:
    problem = define_problem(
        "tuberculosis",
        rates,
        states=[Quantity(name, "1", 1e4, lower=0.0) for name in SHARES],
        controls=[Quantity(name, "1", lower=0.05, upper=0.95) for name in ("u1", "u2")],
        start=at(**{name: share / 120.0 * PEOPLE for name, share in SHARES.items()}),
        phases=fixed_time(5.0, 100),
        integral_cost=lambda x, u: x.L2 + x.I2 + 25.0 * u.u1**2 + 250.0 * u.u2**2,
        cost_scale=5000.0,
    )
    return (Benchmark("tuberculosis", problem, "5152.07310", "Betts 2010"),)
