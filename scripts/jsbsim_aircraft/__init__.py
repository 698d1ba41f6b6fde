"""The six-dof aircraft as a JSBSim model, flown by JSBSim; see `crosscheck.py`."""
