"""A course laid out by hand in a browser: one page on the loopback address, and behind it the track file and solvers
that stay warm."""
