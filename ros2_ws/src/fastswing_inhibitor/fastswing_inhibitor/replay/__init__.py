"""The inhibitor's decisions made again from a bag."""
