"""Build a course from objects instead of a file, in SI units and radians."""

from math import radians

import airrace
from airrace import Course, Gate, Interval, Passage, Passing, Rules, Tolerances

allowed = Tolerances(
    clearance=2.0,
    height=Interval(15.0, 25.0),
    bank=radians(20.0),
    climb=Interval(radians(-20.0), radians(20.0)),
    crossing=radians(45.0),
)
places = {"start": (0.0, 0.0, 0.0), "corner": (500.0, 150.0, 60.0), "finish": (550.0, 700.0, 90.0)}
gates = [
    Gate(name, north, east, 20.0, radians(heading), 13.0, Passing.WINDOW, allowed)
    for name, (north, east, heading) in places.items()
]
course = Course(
    name="Three gates",
    passages=tuple(Passage(name=gate.name, lap=1, element=gate) for gate in gates),
    rules=Rules(n_z=Interval(-2.0, 10.0), height=Interval(lower=10.0)),
)
run = airrace.optimize(course, aircraft="edge540", until="point-mass", search="off")
print(f"{run.race_time:.3f} s")
