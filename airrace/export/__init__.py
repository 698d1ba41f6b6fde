"""Flights in formats that other programs read; there is one file per format."""

from airrace.export.csv import Provenance, export_csv, export_splits_csv

__all__ = ["Provenance", "export_csv", "export_splits_csv"]
