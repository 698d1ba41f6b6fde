"""Prices: what every number of the inputs costs, in seconds per unit, from an optimum that holds."""

from airrace.prices.price import Activity, Group, Price
from airrace.prices.pricing import prices

__all__ = ["Activity", "Group", "Price", "prices"]
