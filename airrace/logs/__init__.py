"""Flown logs: recordings of strangers read with distrust, and the flights that they tell of.

A recording becomes a flight in steps that know nothing of one another: read, put in order, placed in the track's frame,
searched for a run through the course, smoothed, judged.
"""

from airrace.logs.flown import Flown, flown_flight
from airrace.logs.reading import read_log
from airrace.logs.recording import Layout, Recording

__all__ = ["Flown", "Layout", "Recording", "flown_flight", "read_log"]
