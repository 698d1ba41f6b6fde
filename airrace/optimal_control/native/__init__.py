"""The native library: an interpreter of casadi's functions on vectors, sums and a Riccati recursion, in C.

It is built with the wheel. Where it is missing, casadi and numpy evaluate the same, slower.
"""
