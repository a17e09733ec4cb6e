"""MJCF and YAML become muscle lengths, Jacobians and limits."""
