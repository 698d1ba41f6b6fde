"""Safety: deviations of closed-loop flights, and impact footprints when an engine or an aircraft fails."""
