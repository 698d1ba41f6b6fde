"""Safety: how far flights stray in closed loop, what falls where when one fails, and what is near it then."""
