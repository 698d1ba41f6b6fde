"""Views: courses, runs and flights as people see them, in tables, on a terminal, in figures and as SVG."""
