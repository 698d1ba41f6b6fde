"""Safety: how far flights stray, what falls where when one fails, and what is near it then."""
