"""What follows from a flight: results, sensitivities, recorded logs, safety."""
