"""Figures against limits, and recordings against each other."""
