"""The reading of stored stages: all that can be asked of a finished stage without solving, measuring or compiling.

Whatever shows, compares or writes runs imports this module and not `run.py`, so that it never loads a solver.
"""

from airrace.procedure.continuous import continuous
from airrace.procedure.derived import derived_quantities
from airrace.procedure.models import ensure_matches_model
from airrace.procedure.stored import sampler

__all__ = ["continuous", "derived_quantities", "ensure_matches_model", "sampler"]
