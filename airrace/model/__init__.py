"""What flies, where and in what air: frames, aircraft, environment, course, dynamics.

Equations are cited by their numbers in the paper *Optimization of Air Race Trajectories*, see docs/theory/problem.md.
"""
