"""The solver fatrop, called directly through its C interface: everything that knows of it but `solvers.py`."""
