"""Flights in formats that other programs read; there is one file per format."""
