"""Logs recorded in flight: files of strangers read with distrust, and the flights in them.

A recording becomes a flight in steps that know nothing of one another: read, put in order, placed in the track's frame,
searched for a run through the course, smoothed, judged.
"""
