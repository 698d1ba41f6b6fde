"""Sweep the load factor, each run from the optimum before it."""

import airrace

run = airrace.optimize("half_cuban_eight", until="point-mass", guess="plan")
for n_z in (9, 8, 7):
    run = run.resume(set={"rules.n_z_max": n_z})
    print(f"{n_z} g: {run.race_time:.3f} s")
