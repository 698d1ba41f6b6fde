"""What a flight says: results, sensitivities, recorded logs, safety."""
