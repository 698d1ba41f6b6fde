"""The crosscheck: the six-dof aircraft simulated by JSBSim, with another program's equations, Earth and atmosphere."""
