"""The paper's equations, and the planner that puts them together."""
