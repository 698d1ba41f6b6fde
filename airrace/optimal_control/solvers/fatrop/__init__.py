"""The interface to the solver fatrop, which is called directly through its C interface.

Outside this package only `solver.py` beside it knows of it.
"""
