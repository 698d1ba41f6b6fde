"""The engine on a problem of its own: move a mass by one metre, from rest to rest, in the least time."""

from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, solve, uniform

problem = define_problem(
    "sliding mass",
    lambda x, u: {"x": x.v, "v": u.f},
    states=[Quantity("x", "m"), Quantity("v", "m/s", scale=5.0)],
    controls=[Quantity("f", "m/s2", scale=20.0, lower=-20.0, upper=20.0)],
    start=at(x=0.0, v=0.0),
    phases=[
        Phase("push", uniform(10), Interval(0.01, 5.0), bounds={"f": Interval(lower=0.0)}),
        Phase("brake", uniform(10), Interval(0.01, 5.0), at(x=1.0, v=0.0), bounds={"f": Interval(upper=0.0)}),
    ],
)
solution = solve(problem, second_mesh=True)
print(f"{solution}\n{solution.durations}, f from {solution.control('f')[0]:.3f} to {solution.control('f')[-1]:.3f}")
print(f"the answer is {2 / 20**0.5:.6f} s")
