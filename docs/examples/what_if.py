"""What would 10 m/s of wind change? The changed run starts from the optimum in still air."""

import airrace

still = airrace.optimize("half_cuban_eight", until="point-mass", guess="plan")
windy = still.resume(set={"environment.wind.from_deg": 90, "environment.wind.speed_m_s": 10})
print(f"{windy.race_time - still.race_time:+.3f} s")
for leg in still.compare(windy).legs:
    print(f"{leg.name}: {leg.difference:+.3f} s")
