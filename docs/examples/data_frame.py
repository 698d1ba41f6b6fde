"""A flight as a data frame, 50 rows per second (needs pandas)."""

import airrace

run = airrace.optimize("half_cuban_eight", until="point-mass", guess="plan")
flight = run["point-mass"].to_dataframe(rate=50)
print(flight[["V_K_kt", "height_m", "n_z"]].describe().round(2))
flight.to_csv("flight.csv")
