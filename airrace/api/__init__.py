"""The commands as functions, for Python, notebooks and the command line, which is made of their signatures.

Nothing is printed unless it is asked for, and nothing is written but the files that are named. What computes is loaded
when a function is called, so that the command line can read the signatures quickly.
"""

import logging

# Without a handler Python itself prints the warnings of a library.
logging.getLogger("airrace").addHandler(logging.NullHandler())
