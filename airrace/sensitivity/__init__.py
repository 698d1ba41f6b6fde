"""Sensitivities: what every number of the inputs costs, in seconds per unit, from an optimum that holds."""
