"""The interface to the solver fatrop, which is called directly through its C interface.

Outside this package only `solver.py` and `worker.py` beside it know of it.
"""
