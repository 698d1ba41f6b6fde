"""Courses and runs as people see them: a course from above, and the live view of a run under way."""
