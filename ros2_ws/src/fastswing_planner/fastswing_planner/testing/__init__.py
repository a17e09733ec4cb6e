"""Small arms to test on: the planner's own tests use them, and those of programs built on it."""
