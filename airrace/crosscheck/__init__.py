"""The crosscheck: the six-degree-of-freedom aircraft flown by JSBSim, with another program's equations, Earth and
atmosphere.
"""
