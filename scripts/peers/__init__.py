"""The same race stated for several tools of optimal control; see `benchmark_peers.py`."""
