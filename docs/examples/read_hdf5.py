"""Read a checkpoint with h5py alone, as any HDF5 program does."""

import h5py

import airrace

airrace.optimize("half_cuban_eight", until="point-mass", guess="plan").save("run.h5")
with h5py.File("run.h5") as file:
    flight = file["stages/point-mass"]
    speed = flight["states/V_K"]
    print(speed.attrs["long_name"].decode(), speed[:].max(), speed.attrs["units"].decode())
    for row in flight["splits"][:]:
        print(row["name"].decode(), row["time"])
