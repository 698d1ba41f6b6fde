"""The six-degree-of-freedom aircraft flown by JSBSim: another program's equations, Earth and atmosphere."""
