"""The crosscheck: the six-dof aircraft flown by JSBSim, with another program's equations, Earth and atmosphere."""
