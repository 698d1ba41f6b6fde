"""Fly a shipped course, look at the answer, and keep it."""

import airrace

run = airrace.optimize("half_cuban_eight", until="point-mass", guess="plan")
print(f"{run.race_time:.3f} s, certified: {run.certified}")
print(run.splits)
run.save("first.h5")
