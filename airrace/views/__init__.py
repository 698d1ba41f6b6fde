"""Views: courses and runs as people see them, from above and as the live view of a run under way."""
