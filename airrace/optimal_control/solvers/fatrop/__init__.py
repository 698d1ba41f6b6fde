"""The interface to the solver fatrop, which is called directly through its C interface.

Outside this package only `solvers.py` knows of it.
"""
