"""What every number of the inputs costs: seconds per unit, from an optimum that holds, with nothing solved again."""

from airrace.prices.price import Activity, Group, Price
from airrace.prices.pricing import prices

__all__ = ["Activity", "Group", "Price", "prices"]
