"""Flights as one page that opens without a network: the scene in space, histories over time, tables."""
